#pragma once

#include <chrono>

#include "mapjoin/joining/options.h"

namespace mapjoin::cli {

/// Seconds since it was made.
class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// While it lives, Ctrl-C is a request and not the end: the library is asked to stop at the next
/// good moment and nothing half done is left behind. A second Ctrl-C ends the program at once.
class Interruptible {
 public:
  Interruptible();
  ~Interruptible();
  Interruptible(const Interruptible&) = delete;
  Interruptible& operator=(const Interruptible&) = delete;

  static bool requested();
  /// \throws CancelledError when it was requested.
  static void check();
};

/// A bar on standard error, when that is a terminal. Gone when it is destroyed.
class ProgressBar {
 public:
  ProgressBar();
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// For JoinOptions::progress. Also stops the run on Ctrl-C. Use while the bar lives.
  ProgressCallback callback();

 private:
  void draw(const Progress& progress);

  Stopwatch clock_;
  bool visible_;
  bool drawn_ = false;
  double last_ = -1.0;
};

}  // namespace mapjoin::cli
