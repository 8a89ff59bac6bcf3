#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "mapjoin/building/raw_log.h"

namespace mapjoin {

/// When a recording's next local map begins.
struct SegmentRule {
  enum class By {
    kPoses,        ///< after so many poses
    kMaps,         ///< so many maps of equally many poses
    kFeatures,     ///< when so many features have been seen
    kUncertainty,  ///< when odometry from the start is less certain than so many metres (sigma)
    kGraph  ///< about so many maps (a power of two) by graph partition: for data without order
  };
  By by = By::kPoses;
  double amount = 50.0;
};

/// "poses:50", "maps:20", "features:40", "uncertainty:0.5", "graph:16". \throws InputError.
SegmentRule parse_segment_rule(std::string_view text);

/// Which measurements make which local map: maps[k] are numbers of measurements, ascending, and
/// every measurement of the recording is in exactly one.
struct Segmentation {
  std::vector<std::vector<std::int64_t>> maps;
};

/// Cuts a recording into local maps.
///
/// In order of time (all rules but kGraph) a map reaches from one pose to another, the *common
/// pose* that the next one starts from. What a pose measures is of the map that ends at or after
/// it; a relative pose is of the map of its later pose, so a loop closure brings the earlier one
/// along as a variable of both maps.
///
/// `common_features`: a map does not end before it shares that many features with those before it,
/// as maps of features alone need to be joined (2 in the plane, 3 in space); a last one that shares
/// fewer is added to the one before it.
///
/// Features that no single measurement places (ranges, bearings alone) are carried over: where a
/// map would end while such a feature is in sight and not placed yet, it ends before that feature
/// was first seen, or goes on (building/delayed.h). O(measurements log measurements).
/// \throws InputError when the rule's amount makes no sense.
template <int D>
Segmentation segment(const RawLog<D>& log, const SegmentRule& rule, int common_features = 0);

extern template Segmentation segment<2>(const RawLog<2>&, const SegmentRule&, int);
extern template Segmentation segment<3>(const RawLog<3>&, const SegmentRule&, int);

}  // namespace mapjoin
