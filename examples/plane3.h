// A variable type of one's own: oriented planes of space. (Floors, walls, facades.)
#pragma once

#include "direction3.h"

namespace own {

/// The points p with normal . p = offset. Whoever measures planes orients them alike, say with the
/// normal into the room.
struct Plane {
  static constexpr int ambient = 3;
  static constexpr int dim = 3;  // two of the normal, one of the offset
  static constexpr std::string_view name = "plane";
  static constexpr mapjoin::FrameAction action = mapjoin::FrameAction::kGeneral;
  template <class S>
  struct Value {
    Vec<3, S> normal;
    S offset;
  };
  template <class S>
  static Value<S> retract(const Value<S>& x, const Vec<3, S>& d) {
    return {Direction::retract<S>(x.normal, Vec<2, S>(d(0), d(1))), x.offset + d(2)};
  }
  template <class S>
  static Vec<3, S> local(const Value<S>& x, const Value<S>& y) {
    const Vec<2, S> turn = Direction::local<S>(x.normal, y.normal);
    return {turn(0), turn(1), y.offset - x.offset};
  }
  template <class S>
  static Value<S> transform(const mapjoin::Rigid<3, S>& T, const Value<S>& x) {
    const Vec<3, S> normal = T.R * x.normal;
    return {normal, x.offset + normal.dot(T.t)};
  }
  // What maps that share planes are laid on one another by.
  static Vec<3> direction(const Value<double>& x) { return x.normal; }
  static double offset(const Value<double>& x) { return x.offset; }
};
static_assert(mapjoin::VariableType<Plane>);

inline mapjoin::Key plane_key(std::uint64_t id) { return {"plane", 0, id}; }

}  // namespace own
