#include "mapjoin/evaluation/svg.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace mapjoin {

namespace {

constexpr double kMargin = 28;   // around the page and between panels, pixels
constexpr double kHead = 52;     // a panel's title
constexpr double kFoot = 44;     // its scale bar and legend
constexpr double kPadding = 18;  // between a panel's border and the map
constexpr double kLetter = 5.8;  // about the width of one in small print
constexpr const char* kInk = "#1f2933";
constexpr const char* kFaintInk = "#66727f";
constexpr const char* kBorder = "#d8dee4";

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

/// 1, 2 or 5 times a power of ten, at most x.
double round_length(double x) {
  const double power = std::pow(10.0, std::floor(std::log10(x)));
  for (const double factor : {5.0, 2.0}) {
    if (factor * power <= x) return factor * power;
  }
  return power;
}

struct Box {
  Eigen::Array2d low = Eigen::Array2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Array2d high = -low;

  void add(const Eigen::Vector2d& p) {
    low = low.min(p.array());
    high = high.max(p.array());
  }
  bool empty() const { return !(low(0) <= high(0)); }
  Eigen::Array2d size() const {
    return empty() ? Eigen::Array2d::Ones() : Eigen::Array2d(high - low);
  }
  Eigen::Array2d centre() const {
    return empty() ? Eigen::Array2d::Zero() : Eigen::Array2d(0.5 * (low + high));
  }
};

}  // namespace

/// Lays panels out and writes them.
class SvgPage {
 public:
  SvgPage(std::span<const SvgPanel> panels, const SvgOptions& options)
      : panels_(panels), options_(options), top_(kMargin + (options.title.empty() ? 0.0 : 34.0)) {
    const Eigen::Array2d room(options.panel_width - 2 * kPadding,
                              options.panel_height - kHead - kFoot - 2 * kPadding);
    scale_ = std::numeric_limits<double>::infinity();
    for (const SvgPanel& panel : panels) {
      Box box;
      for (const auto& item : panel.items_) {
        for (const auto& p : item.points) box.add(p);
      }
      scale_ = std::min(scale_, (room / box.size().max(1e-9)).minCoeff());
      boxes_.push_back(box);
    }
  }

  std::string text() && {
    const auto n = static_cast<double>(panels_.size());
    const double width = kMargin + n * (options_.panel_width + kMargin);
    const double height = top_ + options_.panel_height + kMargin;
    write(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
        "viewBox=\"0 0 {0:.0f} {1:.0f}\" font-family=\"Helvetica, Arial, 'DejaVu Sans', "
        "sans-serif\">\n",
        width, height);
    write("<rect width=\"100%\" height=\"100%\" fill=\"#f5f7f9\"/>\n");
    if (!options_.title.empty()) label(kMargin, kMargin + 14, 20, kInk, options_.title, true);
    for (std::size_t k = 0; k < panels_.size(); ++k) {
      left_ = kMargin + static_cast<double>(k) * (options_.panel_width + kMargin);
      write_panel(panels_[k], boxes_[k], k);
    }
    write("</svg>\n");
    return std::move(out_);
  }

 private:
  template <class... Args>
  void write(fmt::format_string<Args...> format, Args&&... args) {
    out_ += fmt::format(format, std::forward<Args>(args)...);
  }
  void label(double x, double y, int size, const char* colour, const std::string& text,
             bool strong = false) {
    write("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{}\" fill=\"{}\"{}>{}</text>\n", x, y, size,
          colour, strong ? " font-weight=\"bold\"" : "", escaped(text));
  }

  void write_panel(const SvgPanel& panel, const Box& box, std::size_t number) {
    const double w = options_.panel_width;
    const double h = options_.panel_height;
    write(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" rx=\"8\" "
        "fill=\"#ffffff\" stroke=\"{}\"/>\n",
        left_, top_, w, h, kBorder);
    label(left_ + kPadding, top_ + 26, 16, kInk, panel.title_, true);
    label(left_ + kPadding, top_ + 45, 12, kFaintInk, panel.subtitle_);

    centre_ = box.centre();
    middle_ = Eigen::Array2d(left_ + w / 2, top_ + kHead + (h - kHead - kFoot) / 2);
    write("<g id=\"map{}\" fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\">\n",
          number);
    for (const auto& item : panel.items_) write_item(item);
    write("</g>\n");
    write_scale_bar(top_ + 27);
    write_legend(panel, top_ + h - 18);
  }

  Eigen::Array2d on_page(const Eigen::Vector2d& p) const {
    const Eigen::Array2d from_centre = (p.array() - centre_) * scale_;
    return {middle_(0) + from_centre(0), middle_(1) - from_centre(1)};
  }

  void write_item(const SvgPanel::Item& item) {
    const bool dots = item.shape == SvgPanel::Shape::kDots;
    if (item.points.empty()) return;
    // Dots are lines of no length with round ends.
    write("<path stroke=\"{}\" stroke-width=\"{:g}\" stroke-opacity=\"{:g}\" d=\"",
          item.style.colour, item.style.width, item.style.opacity);
    for (std::size_t k = 0; k < item.points.size(); ++k) {
      const Eigen::Array2d p = on_page(item.points[k]);
      const bool begins =
          dots || k == 0 || (item.shape == SvgPanel::Shape::kSegments && k % 2 == 0);
      write("{}{:.1f} {:.1f}{}", begins ? "M" : "L", p(0), p(1), dots ? "h0" : "");
    }
    write("\"/>\n");
  }

  void write_scale_bar(double y) {
    const double metres = round_length(0.2 * options_.panel_width / scale_);
    const std::string text = fmt::format("{:g} m", metres);
    const double right =
        left_ + options_.panel_width - kPadding - kLetter * static_cast<double>(text.size()) - 6;
    write("<path d=\"M{0:.1f} {1:.1f}v6h{2:.1f}v-6\" fill=\"none\" stroke=\"{3}\"/>\n",
          right - metres * scale_, y - 6, metres * scale_, kFaintInk);
    label(right + 6, y + 1, 11, kFaintInk, text);
  }

  void write_legend(const SvgPanel& panel, double y) {
    double x = left_ + kPadding;
    for (const auto& entry : panel.legend_) {
      const double sample = entry.dot ? 6 : 18;
      write(
          "<path d=\"M{:.1f} {:.1f}h{}\" stroke=\"{}\" stroke-width=\"{:g}\" "
          "stroke-opacity=\"{:g}\" stroke-linecap=\"round\"/>\n",
          entry.dot ? x + 3 : x, y - 3, entry.dot ? 0 : 18, entry.style.colour,
          std::max(entry.style.width, entry.dot ? 4.0 : 1.5), std::max(entry.style.opacity, 0.5));
      label(x + sample + 7, y + 1, 11, kFaintInk, entry.label);
      x += sample + 7 + kLetter * static_cast<double>(entry.label.size()) + 22;
    }
  }

  std::span<const SvgPanel> panels_;
  const SvgOptions& options_;
  double top_;
  double left_ = 0.0;
  double scale_ = 1.0;
  std::vector<Box> boxes_;
  Eigen::Array2d centre_{0, 0};
  Eigen::Array2d middle_{0, 0};
  std::string out_;
};

void SvgPanel::polyline(const Points2& points, const SvgStyle& style) {
  items_.push_back({Shape::kPolyline, points, style});
}
void SvgPanel::segments(const Points2& ends, const SvgStyle& style) {
  items_.push_back({Shape::kSegments, ends, style});
}
void SvgPanel::dots(const Points2& points, const SvgStyle& style) {
  items_.push_back({Shape::kDots, points, style});
}
void SvgPanel::legend(const std::string& label, const SvgStyle& style, bool dot) {
  legend_.push_back({label, style, dot});
}

std::string svg(std::span<const SvgPanel> panels, const SvgOptions& options) {
  return SvgPage(panels, options).text();
}

std::string colour_along(double t) {
  // Piecewise linear between hand-picked colours, dark to light.
  constexpr double kStops[][3] = {
      {38, 70, 160}, {112, 60, 170}, {190, 50, 130}, {226, 84, 70}, {240, 150, 45}};
  constexpr int kLast = 4;
  const double at = std::clamp(t, 0.0, 1.0) * kLast;
  const int k = std::min(static_cast<int>(at), kLast - 1);
  int rgb[3];
  for (int c = 0; c < 3; ++c) {
    rgb[c] =
        static_cast<int>(std::lround(kStops[k][c] + (at - k) * (kStops[k + 1][c] - kStops[k][c])));
  }
  return fmt::format("#{:02x}{:02x}{:02x}", rgb[0], rgb[1], rgb[2]);
}

}  // namespace mapjoin
