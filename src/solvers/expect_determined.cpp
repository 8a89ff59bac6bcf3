#include "mapjoin/solvers/expect_determined.h"

#include "mapjoin/frames/points_anchor.h"
#include "mapjoin/solvers/covariance.h"

namespace mapjoin {

template <int D>
void expect_determined(const Map<D>& map, const Anchor<D>& anchor) {
  if (anchor.kind != &points_anchor_kind<D>() || map.anchor.kind == nullptr) return;
  if (map.information.size() != map.variables().size()) return;
  anchor_rows(anchor, map.values);  // names points that the map lacks, or that coincide
  expect_distinct(anchor, map.values, Covariance<D>(map).of(anchor.keys));
}

template void expect_determined<2>(const Map<2>&, const Anchor<2>&);
template void expect_determined<3>(const Map<3>&, const Anchor<3>&);

}  // namespace mapjoin
