#include "mapjoin/frames/anchors.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/graph/check_local_map.h"
#include "mapjoin/graph/dense.h"

namespace mapjoin {

namespace {

constexpr Tag kPoseTag("pose");

template <int D>
Rigid<D> pose_frame(const double* const* values, const Key*) {
  return motion_into(*reinterpret_cast<const Rigid<D>*>(values[0]));
}
template <int D>
void pose_rows(const double* const*, double* P) {
  Eigen::Map<Mat<kGauge<D>, kGauge<D>>> rows(P);
  rows.setIdentity();
}
template <int D>
void pin_pose(double* const* values) {
  *reinterpret_cast<Rigid<D>*>(values[0]) = Rigid<D>::identity();
}

template <int D>
constexpr AnchorKind<D> make_pose_anchor() {
  AnchorKind<D> kind;
  kind.tag = kPoseTag;
  kind.arity = 1;
  kind.types = &kPoseTag;
  kind.tangent = kGauge<D>;
  kind.frame = &pose_frame<D>;
  kind.rows = &pose_rows<D>;
  kind.pin = &pin_pose<D>;
  return kind;
}
template <int D>
constexpr AnchorKind<D> kPoseAnchor = make_pose_anchor<D>();

template <int D, class V>
auto value_pointers(V& values, const std::vector<int>& variables) {
  std::vector<decltype(values.value(0))> out;
  for (const int i : variables) out.push_back(values.value(i));
  return out;
}

}  // namespace

template <int D>
const AnchorKind<D>& pose_anchor_kind() {
  return kPoseAnchor<D>;
}

template <int D>
Rigid<D> motion_into(const Rigid<D>& pose) {
  Rigid<D> near = pose;  // one Newton step towards the nearest rotation
  near.R = pose.R * (1.5 * Mat<D, D>::Identity() - 0.5 * (pose.R.transpose() * pose.R));
  return near.inverse();
}

template <int D>
std::string to_string(const Anchor<D>& anchor) {
  if (anchor.kind == nullptr || anchor.keys.empty()) return "no anchor";
  const std::vector<Key>& keys = anchor.keys;
  if (keys.size() == 1 && keys[0].type == anchor.kind->tag) return to_string(keys[0]);
  const bool alike = std::all_of(keys.begin(), keys.end(),
                                 [&](const Key& key) { return key.type == keys[0].type; });
  std::string out = anchor.kind->tag.text() + ":";
  for (std::size_t k = 0; k < keys.size(); ++k) {
    if (k > 0) out += ",";
    if (!alike) {
      out += to_string(keys[k]);
    } else {
      if (keys[k].session != 0) out += fmt::format("{}/", keys[k].session);
      out += fmt::format("{}", keys[k].id);
    }
  }
  return out;
}

template <int D>
std::vector<int> anchor_variables(const Anchor<D>& anchor, const VariableSet<D>& variables) {
  check_anchor(anchor);
  std::vector<int> out;
  for (const Key& key : anchor.keys) out.push_back(variables.require(key, "anchor"));
  return out;
}

template <int D>
Rigid<D> motion_into(const Anchor<D>& anchor, const Values<D>& values) {
  const std::vector<int> variables = anchor_variables(anchor, values.variables());
  const auto pointers = value_pointers<D>(values, variables);
  return anchor.kind->frame(pointers.data(), anchor.keys.data());
}

template <int D>
AnchorRows anchor_rows(const Anchor<D>& anchor, const Values<D>& values) {
  constexpr int G = kGauge<D>;
  AnchorRows out;
  out.variables = anchor_variables(anchor, values.variables());
  const auto pointers = value_pointers<D>(values, out.variables);
  out.P.resize(G, anchor.kind->tangent);
  anchor.kind->frame(pointers.data(), anchor.keys.data());  // says best what is degenerate
  anchor.kind->rows(pointers.data(), out.P.data());
  Eigen::MatrixXd g(anchor.kind->tangent, G);
  int row = 0;
  for (const int i : out.variables) {
    const VariableKind<D>& kind = values.variables().kind(i);
    Eigen::MatrixXd block(kind.dim, G);
    kind.gauge(values.value(i), 1, block.data());
    g.middleRows(row, kind.dim) = block;
    row += kind.dim;
    for (int k = 0; k < kind.dim; ++k) out.scalars.push_back(values.variables().offset(i) + k);
  }
  out.C = times(out.P, g);
  if (!is_regular(out.C)) {
    throw DegenerateFrameError(
        fmt::format("{} does not fix a frame: what it pins leaves the map free to move; choose "
                    "other variables, or anchor the map at a pose",
                    to_string(anchor)));
  }
  for (int r = 0; r < G; ++r) {
    int count = 0, scalar = 0;
    for (int k = 0; k < anchor.kind->tangent; ++k) {
      if (out.P(r, k) == 0.0) continue;
      ++count;
      scalar = out.scalars[static_cast<std::size_t>(k)];
    }
    if (count != 1) {
      out.pinned.clear();
      return out;
    }
    out.pinned.push_back(scalar);
  }
  std::sort(out.pinned.begin(), out.pinned.end());
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                            \
  template const AnchorKind<D>& pose_anchor_kind<D>();                                    \
  template Rigid<D> motion_into<D>(const Rigid<D>&);                                      \
  template std::string to_string<D>(const Anchor<D>&);                                    \
  template std::vector<int> anchor_variables<D>(const Anchor<D>&, const VariableSet<D>&); \
  template Rigid<D> motion_into<D>(const Anchor<D>&, const Values<D>&);                   \
  template AnchorRows anchor_rows<D>(const Anchor<D>&, const Values<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
