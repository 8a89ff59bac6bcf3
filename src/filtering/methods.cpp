#include "mapjoin/filtering/methods.h"

#include <fmt/format.h>

#include "mapjoin/filtering/dslam.h"
#include "mapjoin/filtering/ekf_join.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/joining/join_all.h"

namespace mapjoin {

namespace {

template <int D>
FilterResult<D> linear(std::span<const LocalMap<D>> local_maps, const JoinOptions& options) {
  JoinResult<D> result = join_all(local_maps, options);
  if (result.maps.size() > 1)
    throw DisconnectedError(
        fmt::format("the local maps are {} pieces that nothing links; the one of {} stands apart",
                    result.maps.size(), to_string(result.maps[1].anchor)));
  FilterResult<D> out;
  out.map = std::move(result.maps[0]);
  out.report.scalars = out.map.variables().scalars() - kGauge<D>;
  out.report.chi2 = result.report.chi2;
  out.report.refine_solves = result.report.refine_solves;
  out.report.seconds_refine = result.report.seconds_refine;
  out.report.minimum = result.report.minimum;
  return out;
}

}  // namespace

std::string_view name(Method method) {
  switch (method) {
    case Method::kLinear:
      return "linear";
    case Method::kSlsjf:
      return "slsjf";
    case Method::kIslsjf:
      return "islsjf";
    case Method::kDslam:
      return "dslam";
    case Method::kIdslam:
      return "idslam";
    case Method::kEkf:
      return "ekf";
  }
  return "";
}

Method parse_method(std::string_view text) {
  std::string names;
  for (const Method method : kMethods) {
    if (name(method) == text) return method;
    names += fmt::format("{}{}", names.empty() ? "" : ", ", name(method));
  }
  throw InputError(fmt::format("there is no method '{}'; the methods are {}", text, names));
}

bool keeps_poses(Method method) {
  return method == Method::kLinear || method == Method::kSlsjf || method == Method::kIslsjf;
}

template <int D>
FilterResult<D> join_by(Method method, std::span<const LocalMap<D>> local_maps,
                        const MethodOptions& options) {
  const ProgressCallback& progress = options.join.progress;
  switch (method) {
    case Method::kLinear:
      return linear(local_maps, options.join);
    case Method::kSlsjf:
      return slsjf(local_maps, options.filter, progress);
    case Method::kIslsjf:
      return islsjf(local_maps, options.filter, progress);
    case Method::kDslam:
      return dslam(local_maps, options.filter, progress);
    case Method::kIdslam:
      return idslam(local_maps, options.filter, progress);
    case Method::kEkf:
      return ekf_join(local_maps, progress);
  }
  throw InputError("no such method");
}

template FilterResult<2> join_by<2>(Method, std::span<const LocalMap<2>>, const MethodOptions&);
template FilterResult<3> join_by<3>(Method, std::span<const LocalMap<3>>, const MethodOptions&);

}  // namespace mapjoin
