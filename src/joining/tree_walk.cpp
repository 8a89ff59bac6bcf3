#include "mapjoin/joining/tree_walk.h"

namespace mapjoin {

ForestPart part_of(std::span<const FrontTask> nodes, std::span<const char> marked) {
  ForestPart out;
  std::vector<std::int32_t> place(nodes.size(), -1);
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    if (marked[n] != 0) continue;
    place[n] = static_cast<std::int32_t>(out.nodes.size());
    out.nodes.push_back(nodes[n]);
    out.number.push_back(static_cast<std::int32_t>(n));
  }
  for (std::size_t k = out.nodes.size(); k-- > 0;) {  // parents first
    FrontTask& node = out.nodes[k];
    if (node.parent < 0) continue;
    const auto above = static_cast<std::size_t>(node.parent);
    node.parent = place[above];
    node.path_cost -= nodes[above].path_cost;
    if (node.parent >= 0)
      node.path_cost += out.nodes[static_cast<std::size_t>(node.parent)].path_cost;
  }
  return out;
}

}  // namespace mapjoin
