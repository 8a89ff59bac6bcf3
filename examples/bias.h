// A variable type of one's own: a number that no change of frame touches. (The bias of a gyroscope,
// the scale of a wheel.)
#pragma once

#include "mapjoin/graph/key.h"
#include "mapjoin/graph/variable.h"

namespace own {

template <int D>
struct Bias {
  static constexpr int ambient = D;
  static constexpr int dim = 1;
  static constexpr std::string_view name = "bias";
  static constexpr mapjoin::FrameAction action = mapjoin::FrameAction::kInvariant;
  template <class S>
  using Value = mapjoin::Vec<1, S>;
  template <class S>
  static Value<S> retract(const Value<S>& x, const Value<S>& d) {
    return x + d;
  }
  template <class S>
  static Value<S> local(const Value<S>& x, const Value<S>& y) {
    return y - x;
  }
  template <class S>
  static Value<S> transform(const mapjoin::Rigid<D, S>&, const Value<S>& x) {
    return x;
  }
};
static_assert(mapjoin::VariableType<Bias<2>> && mapjoin::VariableType<Bias<3>>);

inline mapjoin::Key bias_key(std::uint64_t id) { return {"bias", 0, id}; }

}  // namespace own
