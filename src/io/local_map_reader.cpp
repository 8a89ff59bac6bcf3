#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <utility>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/io/euler_chart.h"
#include "mapjoin/io/local_map_files.h"
#include "mapjoin/io/local_map_raw.h"
#include "mapjoin/io/local_maps.h"

namespace mapjoin {

namespace {

using detail::LocalMapFile;
using detail::RawMap;
using detail::Run;

/// Below this |cos(pitch)| the angles of a 3D pose are useless: information of yaw and roll is lost
/// to rounding.
constexpr double kGimbalLock = 1e-6;

/// What all runs of a set together say about it.
struct Shape {
  bool pose_feature = false;
  int dimension = 0;
  std::string decided_at;

  bool is_pose(const Run& run) const { return !pose_feature || run.id < 0; }
};

[[noreturn]] void fail_run(const RawMap& map, const Run& run, std::string_view problem) {
  throw InputError(
      fmt::format("{}: id {} stands on {} lines in a row, but {}; check the ids of the state",
                  map.where(run.line), run.id, run.length, problem));
}

/// 2 or 3, or 0 when the run fits both.
int dimension_of(const RawMap& map, const Run& run, const Shape& shape) {
  if (shape.pose_feature) {
    if (run.id == 0) {
      throw InputError(fmt::format(
          "{}: id 0 is neither a pose (negative) nor a feature (positive); number from 1",
          map.where(run.line)));
    }
    if (run.length == (run.id < 0 ? 3 : 2)) return 2;
    if (run.length == (run.id < 0 ? 6 : 3)) return 3;
    fail_run(map, run, "poses of a pose-feature set take 3 (2D) or 6 (3D), features 2 or 3");
  }
  if (run.length % 3 != 0) fail_run(map, run, "poses take 3 (2D) or 6 (3D) numbers each");
  return run.length % 6 == 0 ? 0 : 2;
}

Shape shape_of(const std::vector<RawMap>& maps) {
  Shape shape;
  for (const RawMap& map : maps) {
    for (const Run& run : map.runs) shape.pose_feature |= run.id < 0;
  }
  for (const RawMap& map : maps) {
    for (const Run& run : map.runs) {
      const int dimension = dimension_of(map, run, shape);
      if (dimension == 0 || dimension == shape.dimension) continue;
      if (shape.dimension != 0) {
        fail_run(map, run,
                 fmt::format("that is {}D, while {} is {}D", dimension, shape.decided_at,
                             shape.dimension));
      }
      shape.dimension = dimension;
      shape.decided_at = map.where(run.line);
    }
  }
  if (shape.dimension == 0) shape.dimension = 3;
  return shape;
}

/// Brings the rows and columns of a pose into the library's tangent: I <- B^T I B.
template <int D>
void change_chart(Eigen::MatrixXd& information, int at, const Rigid<D>& pose, const double* x) {
  constexpr int N = kGauge<D>;
  const Eigen::Matrix<double, N, N> B = file_chart_jacobian<D>(pose, x);
  const Eigen::Matrix<double, Eigen::Dynamic, N> columns = information.middleCols<N>(at) * B;
  information.middleCols<N>(at) = columns;
  const Eigen::Matrix<double, N, Eigen::Dynamic> rows =
      B.transpose() * information.middleRows<N>(at);
  information.middleRows<N>(at) = rows;
}

template <int D>
class MapMaker {
 public:
  MapMaker(const Shape& shape, const LocalMapOptions& options)
      : shape_(shape), options_(options), gate_(options.indefinite) {}

  LocalMap<D> make(RawMap& raw) {
    LocalMap<D> map;
    map.anchor =
        pose_anchor<D>(pose_key(static_cast<std::uint64_t>(raw.reference), options_.session));
    offsets_.assign(1, 0);
    parts_.clear();
    for (const Run& run : raw.runs) {
      if (shape_.is_pose(run)) {
        for (int k = 0; k < run.length; k += kGauge<D>) add_pose(raw, run, run.first + k, map);
      } else {
        add_point(raw, run, map);
      }
    }
    gate_.check(raw.information, parts_, {raw.file, raw.matrix_line});
    map.information = SymmetricBlockMatrix::from_dense(offsets_, raw.information);
    return map;
  }

  std::int64_t finish() const {
    gate_.finish("set");
    return gate_.repaired();
  }

 private:
  void add_pose(RawMap& raw, const Run& run, int at, LocalMap<D>& map) {
    const double* x = raw.state.data() + at;
    const Key key = pose_key(static_cast<std::uint64_t>(std::abs(run.id)), options_.session);
    if (key == map.anchor.keys[0]) {
      throw InputError(
          fmt::format("{}: pose {} is in the state, but it is the reference pose itself; remove "
                      "it from the state",
                      raw.where(run.line), key.id));
    }
    if constexpr (D == 3) {
      if (angles_regularity({x[3], x[4], x[5]}) < kGimbalLock) {
        throw InputError(
            fmt::format("{}: pose {} has a pitch of {} rad, where the angles of this format do "
                        "not tell yaw from "
                        "roll; use a g2o file or native maps for such data",
                        raw.where(run.line), key.id, x[4]));
      }
    }
    const Rigid<D> pose = pose_from_file_coordinates<D>(x);
    change_chart<D>(raw.information, at, pose, x);
    map.template add_term<PoseType<D>>(key, pose);
    add_parts({D, kRotation<D>});
  }

  void add_point(const RawMap& raw, const Run& run, LocalMap<D>& map) {
    const Vec<D> point = Eigen::Map<const Vec<D>>(raw.state.data() + run.first);
    map.template add_term<PointType<D>>(
        point_key(static_cast<std::uint64_t>(run.id), options_.session), point);
    add_parts({D});
  }

  void add_parts(std::initializer_list<int> sizes) {
    int end = offsets_.back();
    for (const int size : sizes) end += size;
    offsets_.push_back(end);
    parts_.insert(parts_.end(), sizes);
  }

  const Shape& shape_;
  const LocalMapOptions& options_;
  InformationGate gate_;
  std::vector<int> offsets_;
  std::vector<int> parts_;
};

template <int D>
LocalMapSet<D> make_set(std::vector<RawMap> raw, const Shape& shape,
                        const LocalMapOptions& options) {
  LocalMapSet<D> set;
  set.pose_feature = shape.pose_feature;
  MapMaker<D> maker(shape, options);
  for (RawMap& map : raw) {
    set.maps.push_back(maker.make(map));
    map = {};
  }
  set.repaired = maker.finish();
  return set;
}

std::vector<LocalMapFile> contiguous_files(const std::filesystem::path& folder) {
  std::vector<LocalMapFile> files = detail::local_map_files(folder);
  if (files.empty()) {
    throw InputError(fmt::format(
        "'{}' holds no localmap_K.txt or localmap_K.mat (K = 1, 2, ...); give the folder of a "
        "local-map set",
        folder.string()));
  }
  std::string missing;
  int shown = 0;
  for (std::size_t k = 1; k < files.size(); ++k) {
    if (files[k].number == files[k - 1].number) {
      throw InputError(fmt::format("'{}' and '{}' have the same number; remove one",
                                   files[k - 1].path.string(), files[k].path.string()));
    }
    for (std::int64_t n = files[k - 1].number + 1; n < files[k].number && shown <= 10;
         ++n, ++shown) {
      missing += shown == 10 ? " ..."
                             : fmt::format(" localmap_{}{}", n, files[k].path.extension().string());
    }
  }
  if (!missing.empty()) {
    throw InputError(fmt::format(
        "'{}' has gaps, missing are:{}; the set has to be complete, or numbered without gaps",
        folder.string(), missing));
  }
  return files;
}

}  // namespace

AnyLocalMapSet read_local_maps(const std::filesystem::path& folder,
                               const LocalMapOptions& options) {
  const std::vector<LocalMapFile> files = contiguous_files(folder);
  std::vector<RawMap> raw;
  raw.reserve(files.size());
  std::int64_t repaired = 0;
  for (const LocalMapFile& file : files) {
    raw.push_back(
        file.path.extension() == ".mat"
            ? detail::read_raw_matlab(file.path, file.number, options.indefinite, repaired)
            : detail::read_raw_text(file.path));
  }
  const Shape shape = shape_of(raw);
  const auto make = [&]<int D>() -> AnyLocalMapSet {
    LocalMapSet<D> set = make_set<D>(std::move(raw), shape, options);
    set.first_number = static_cast<int>(files.front().number);
    set.repaired += repaired;
    return set;
  };
  return shape.dimension == 2 ? make.template operator()<2>() : make.template operator()<3>();
}

}  // namespace mapjoin
