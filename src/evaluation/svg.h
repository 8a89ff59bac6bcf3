#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "mapjoin/graph/values.h"

/// \file
/// Pictures of maps as SVG, which every browser shows and every text processor takes.
///
///     SvgPanel before("Before", "local maps laid end to end");
///     before.polyline(positions(map), {colour_along(0.3), 1.6});
///     before.legend("trajectory", {colour_along(0.3), 1.6});
///     const std::string text = svg({&before, 1});

namespace mapjoin {

using Points2 = std::vector<Eigen::Vector2d>;

/// How something is drawn. Widths are in pixels, whatever the scale of the map.
struct SvgStyle {
  std::string colour = "#333333";
  double width = 1.5;  ///< of lines, or diameter of dots
  double opacity = 1.0;
};

/// One map, with its title, scale bar and legend. Coordinates in metres, y up; what is drawn first
/// lies below.
class SvgPanel {
 public:
  explicit SvgPanel(std::string title, std::string subtitle = {})
      : title_(std::move(title)), subtitle_(std::move(subtitle)) {}

  void polyline(const Points2& points, const SvgStyle& style);
  /// Separate segments: points 0-1, 2-3, ...
  void segments(const Points2& ends, const SvgStyle& style);
  void dots(const Points2& points, const SvgStyle& style);

  /// An entry of the legend, shown as a line or as a dot.
  void legend(const std::string& label, const SvgStyle& style, bool dot = false);

 private:
  friend class SvgPage;
  enum class Shape { kPolyline, kSegments, kDots };
  struct Item {
    Shape shape;
    Points2 points;
    SvgStyle style;
  };
  struct Entry {
    std::string label;
    SvgStyle style;
    bool dot;
  };
  std::string title_, subtitle_;
  std::vector<Item> items_;
  std::vector<Entry> legend_;
};

struct SvgOptions {
  std::string title;         ///< above all panels
  double panel_width = 620;  ///< pixels
  double panel_height = 620;
};

/// The panels side by side, all to the same scale. O(points).
std::string svg(std::span<const SvgPanel> panels, const SvgOptions& options = {});

/// A colour for each time from 0 to 1: blue, violet, red, orange; told apart by the colour-blind by
/// lightness.
std::string colour_along(double t);

/// Positions of poses or points, in order of their keys; space is seen from above at an angle.
template <VariableType T, int D>
Points2 positions(const Values<D>& values) {
  Points2 out;
  for (const auto& x : values.template column<T>()) {
    const Vec<D> p = T::position(x);
    if constexpr (D == 2) {
      out.emplace_back(p(0), p(1));
    } else {
      out.emplace_back(0.866 * (p(0) - p(1)), 0.5 * (p(0) + p(1)) * 0.7 + 0.85 * p(2));
    }
  }
  return out;
}

}  // namespace mapjoin
