#pragma once

#include <array>
#include <optional>
#include <string_view>

/// \file
/// Figures of others, quoted for comparison and never measured here.

namespace mapjoin::benchmarks {

/// What is known of a data set by its name.
struct Published {
  std::string_view name;
  bool local_maps = false;  ///< a set of local maps, not a graph
  double optimum = 0.0;     ///< chi2 of the nonlinear least squares optimum

  // Seconds of other solvers, all on one machine that is not ours; 0: not known. Initial values are
  // given to them and not counted.
  double cholmod = 0.0;  ///< one factorisation by CHOLMOD, one thread: the measure of that machine
  double g2o = 0.0;      ///< one thread
  double gtsam = 0.0;    ///< two threads
  double se_sync = 0.0;
};

inline constexpr std::array kPublished = {
    Published{"csail_1045", false, 40.555129, .0010, .0040},
    Published{"intel_943", false, 546.4611, .0025, .0066, .026},
    Published{"intel_1728", false, 45.004696, .0035, .0118},
    Published{"manhattan_3500", false, 137.9130, .0080, .035, .143},
    Published{"manhattan_3500_anisotropic", false, 3549.0368, .0080, .024},
    Published{"city_10000", false, 511.9852, .073, .179, .62, 32.0},
    Published{"parking_garage_1661", false, 1.288830, .030, .049, .144, 5.8},
    Published{"sphere_2500", false, 1153.8544, .085, .76, .355, 53.0},
    Published{"torus_5000", false, 24233.0187, .20, 2.9, 1.05, 81.0},
    Published{"victoria_park", false, 9012.7196},
    Published{"dlr", false, 27688.5556},
    Published{"intel_943", true, 546.4611},
    Published{"victoria_park_200", true, 3643.4349},
    Published{"victoria_park_6898", true, 9012.7196},
    Published{"dlr_200", true, 11163.6435},
    Published{"dlr_3298", true, 27688.5556},
    Published{"simu_8240_50", true, 458.1544},
    Published{"simu_35188_700", true, 10315.6331},
};

inline std::optional<Published> published(std::string_view name, bool local_maps) {
  for (const Published& p : kPublished) {
    if (p.name == name && p.local_maps == local_maps) return p;
  }
  return std::nullopt;
}

}  // namespace mapjoin::benchmarks
