#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>

#include "benchmarks/goals.h"
#include "benchmarks/tables.h"

namespace mapjoin::benchmarks {

namespace {

// Pixels.
constexpr double kLeft = 230, kWidth = 520, kTop = 62, kBar = 14, kGap = 10, kRight = 60;
constexpr std::array kColours = {"#2c6fbb", "#e08a1e", "#5a9e5a", "#8a5fb0"};

double scale_of(std::span<const Comparison> comparisons) {
  double largest = kGoalOneThread;
  for (const Comparison& c : comparisons) {
    for (const ThreadFigures& t : c.threads) largest = std::max(largest, t.ratio());
  }
  return kWidth / (1.05 * largest);
}

/// Names come from files, which may be called anything.
std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&') {
      out += "&amp;";
    } else if (c == '<') {
      out += "&lt;";
    } else {
      out += c;
    }
  }
  return out;
}

std::string text(double x, double y, const char* anchor, const std::string& what) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", x, y, anchor,
                     what);
}

std::string bar(double y, double width, const char* colour, double ratio) {
  return fmt::format("<rect x=\"{}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{}\" fill=\"{}\"/>\n",
                     kLeft, y, width, kBar - 2, colour) +
         text(kLeft + width + 5, y + kBar - 3, "start", fmt::format("{:.2f}", ratio));
}

std::string line(double x, double bottom, const char* style) {
  return fmt::format("<path d=\"M{:.1f} {}V{:.1f}\" stroke=\"#66727f\" {}/>\n", x, kTop - 6, bottom,
                     style);
}

}  // namespace

std::string chart(std::span<const Comparison> comparisons) {
  const double scale = scale_of(comparisons);
  std::string bars, legend;
  double y = kTop;
  for (const Comparison& c : comparisons) {
    const double height = kBar * static_cast<double>(c.threads.size());
    bars += text(kLeft - 8, y + 0.5 * height + 3, "end", escaped(c.name));
    for (std::size_t t = 0; t < c.threads.size(); ++t, y += kBar) {
      const double ratio = c.threads[t].ratio();
      bars += bar(y, ratio * scale, kColours[t % kColours.size()], ratio);
    }
    y += kGap;
  }
  if (!comparisons.empty()) {
    double x = kLeft;
    for (std::size_t t = 0; t < comparisons[0].threads.size(); ++t, x += 100) {
      const int threads = comparisons[0].threads[t].threads;
      legend += fmt::format("<rect x=\"{}\" y=\"34\" width=\"10\" height=\"10\" fill=\"{}\"/>\n", x,
                            kColours[t % kColours.size()]);
      legend +=
          text(x + 15, 43, "start", fmt::format("{} thread{}", threads, threads == 1 ? "" : "s"));
    }
    legend += text(x + 15, 43, "start",
                   fmt::format("dashed: goals, {} and {}", kGoalOneThread, kGoalTwoThreads));
  }
  const std::string lines = line(kLeft + scale, y, "") +
                            line(kLeft + kGoalOneThread * scale, y, "stroke-dasharray=\"4 3\"") +
                            line(kLeft + kGoalTwoThreads * scale, y, "stroke-dasharray=\"4 3\"");
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" "
      "viewBox=\"0 0 {0} {1}\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#1f2933\">\n"
      "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
      "{2}{3}{4}{5}</svg>\n",
      kLeft + kWidth + kRight, y + 16,
      text(16, 22, "start",
           "Time to the optimum, without initial values, in factorisations by CHOLMOD"),
      legend, lines, bars);
}

}  // namespace mapjoin::benchmarks
