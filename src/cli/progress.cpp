#include "mapjoin/cli/progress.h"

#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <string>

#include "mapjoin/cli/terminal.h"
#include "mapjoin/graph/error.h"

namespace mapjoin::cli {

namespace {

constexpr double kRedraw = 0.1;  // seconds
constexpr int kWidth = 30;

volatile std::sig_atomic_t interrupted = 0;

void on_interrupt(int) { interrupted = 1; }

}  // namespace

Interruptible::Interruptible() {
  struct sigaction action = {};
  action.sa_handler = &on_interrupt;
  action.sa_flags = static_cast<int>(SA_RESETHAND);  // the second one is the system's
  sigaction(SIGINT, &action, nullptr);
}

Interruptible::~Interruptible() { std::signal(SIGINT, SIG_DFL); }

bool Interruptible::requested() { return interrupted != 0; }

void Interruptible::check() {
  if (requested()) throw CancelledError("stopped by Ctrl-C; nothing was written");
}

ProgressBar::ProgressBar() : visible_(is_terminal(Stream::kErr)) {}

ProgressBar::~ProgressBar() {
  if (!drawn_) return;
  std::fputs("\r\033[K", stderr);
  std::fflush(stderr);
}

ProgressCallback ProgressBar::callback() {
  return [this](const Progress& progress) {
    if (visible_ && clock_.seconds() - last_ >= kRedraw) draw(progress);
    return !Interruptible::requested();
  };
}

void ProgressBar::draw(const Progress& progress) {
  last_ = clock_.seconds();
  drawn_ = true;
  const double fraction = std::clamp(progress.fraction, 0.0, 1.0);
  const int filled = static_cast<int>(fraction * kWidth);
  fmt::print(stderr, "\r\033[K{:<8}[{:<{}}] {:3.0f}%  {:.1f} s", progress.phase,
             std::string(static_cast<std::size_t>(filled), '='), kWidth, 100 * fraction, last_);
  std::fflush(stderr);
}

}  // namespace mapjoin::cli
