#pragma once

#include <string>
#include <vector>

#include "mapjoin/graph/map.h"

namespace mapjoin::cli {

/// What the demo drew its results from.
struct DemoMaps {
  const Values<2>& truth;
  const std::vector<Map<2>>& local_maps;       ///< each from its first pose, in order of time
  const std::vector<Rigid2>& laid_end_to_end;  ///< where each lies when put on the end of the last
  const Map<2>& joined;
};

/// Two panels: the local maps laid end to end, and joined. With the truth in grey.
std::string demo_picture(const DemoMaps& maps);

}  // namespace mapjoin::cli
