#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mapjoin/filtering/filter_options.h"
#include "mapjoin/filtering/slsjf.h"
#include "mapjoin/joining/options.h"

/// \file
/// Every method by its name: what programs choose from.

namespace mapjoin {

enum class Method {
  kLinear,  ///< "linear": Linear SLAM, by divide and conquer or in order; JoinOptions say how
  kSlsjf,   ///< "slsjf": Sparse Local Submap Joining Filter
  kIslsjf,  ///< "islsjf": its result smoothed over all local maps
  kDslam,   ///< "dslam": D-SLAM map joining, features alone
  kIdslam,  ///< "idslam": its iterated form, I-DMJ
  kEkf      ///< "ekf": map joining by a dense Kalman filter
};

/// In the order of the enum.
inline constexpr Method kMethods[] = {Method::kLinear, Method::kSlsjf,  Method::kIslsjf,
                                      Method::kDslam,  Method::kIdslam, Method::kEkf};

std::string_view name(Method method);
/// \throws InputError that lists the names.
Method parse_method(std::string_view name);
/// Are the poses of the robot part of its map?
bool keeps_poses(Method method);

struct MethodOptions {
  JoinOptions join;      ///< kLinear
  FilterOptions filter;  ///< the information filters
};

/// Joins local maps by a method, in their order. `progress` of the JoinOptions is told of all.
///
/// The report's `chi2` is over all local maps; of methods that drop poses over feature-only local
/// maps (kDslam, kIdslam), and zero for kEkf, whose map has none of the poses the local maps speak
/// of. A method of one piece: \throws DisconnectedError where linear joining finds several; else as
/// the method.
template <int D>
FilterResult<D> join_by(Method method, std::span<const LocalMap<D>> local_maps,
                        const MethodOptions& options = {});

}  // namespace mapjoin
