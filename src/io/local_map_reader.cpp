#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <string>
#include <utility>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/io/euler_chart.h"
#include "mapjoin/io/local_map_files.h"
#include "mapjoin/io/local_maps.h"
#include "mapjoin/io/read_file.h"
#include "mapjoin/io/text_scanner.h"

namespace mapjoin {

namespace {

using detail::LocalMapFile;

/// Below this |cos(pitch)| the angles of a 3D pose are useless: information of yaw and roll is lost
/// to rounding.
constexpr double kGimbalLock = 1e-6;
constexpr double kAsymmetry = 1e-6;  // relative

/// Lines of equal ids.
struct Run {
  std::int64_t id = 0;
  int first = 0;
  int length = 0;
  std::int64_t line = 0;
};

/// A file as it stands, before anyone knows whether it is 2D or 3D.
struct RawMap {
  std::string file;
  std::int64_t reference = 0;
  std::vector<Run> runs;
  std::vector<double> state;
  Eigen::MatrixXd information;
  std::int64_t matrix_line = 0;
};

void next_line(TextScanner& scan, const std::string& what) {
  if (scan.next_line()) return;
  throw InputError(fmt::format("{}: the file ends before {}; it is truncated: write it again",
                               scan.where(), what));
}

void read_state(TextScanner& scan, RawMap& map, int n) {
  map.state.reserve(static_cast<std::size_t>(n));
  for (int k = 0; k < n; ++k) {
    next_line(scan, fmt::format("number {} of the {} of the state", k + 1, n));
    scan.expect("id value");
    const std::int64_t id = scan.integer("the id");
    map.state.push_back(scan.number("the value"));
    scan.expect_end_of_line("the value");
    if (map.runs.empty() || map.runs.back().id != id) map.runs.push_back({id, k, 0, scan.line()});
    ++map.runs.back().length;
  }
}

void check_symmetry(const TextScanner& scan, const RawMap& map, int row) {
  const Eigen::MatrixXd& I = map.information;
  for (int j = 0; j < row; ++j) {
    const double difference = std::abs(I(row, j) - I(j, row));
    if (difference == 0.0) continue;
    const double scale = std::max(
        {std::abs(I(row, j)), std::abs(I(j, row)), std::sqrt(std::abs(I(row, row) * I(j, j)))});
    if (difference <= kAsymmetry * scale) continue;
    throw InputError(fmt::format(
        "{}: the information matrix is not symmetric: row {} column {} is {}, but row {} column {} "
        "is {}; write both the same",
        scan.where(), row + 1, j + 1, I(row, j), j + 1, row + 1, I(j, row)));
  }
}

void read_information(TextScanner& scan, RawMap& map, int n) {
  map.information.resize(n, n);
  for (int i = 0; i < n; ++i) {
    next_line(scan, fmt::format("row {} of the {} of the information matrix", i + 1, n));
    if (i == 0) map.matrix_line = scan.line();
    for (int j = 0; j < n; ++j) map.information(i, j) = scan.number("the information matrix's row");
    scan.expect_end_of_line("a row of the information matrix");
    check_symmetry(scan, map, i);
    for (int j = 0; j < i; ++j) {
      map.information(i, j) = map.information(j, i) =
          0.5 * (map.information(i, j) + map.information(j, i));
    }
  }
}

RawMap read_raw(const std::filesystem::path& path) {
  const std::string text = read_file(path);
  RawMap map;
  map.file = path.string();
  TextScanner scan(map.file, text);
  next_line(scan, "the id of the reference pose");
  scan.expect("the id of the reference pose, alone");
  map.reference = std::abs(scan.integer("the id of the reference pose"));
  scan.expect_end_of_line("the id of the reference pose");
  next_line(scan, "the dimension of the state");
  scan.expect("the dimension of the state, alone");
  const std::int64_t n = scan.integer("the dimension of the state");
  scan.expect_end_of_line("the dimension of the state");
  // A state and its matrix take at least two bytes a number: a larger n is a lie that must not be
  // allocated.
  if (n < 1 || n > static_cast<std::int64_t>(text.size()) ||
      n * n > static_cast<std::int64_t>(text.size())) {
    scan.fail(fmt::format("a state of dimension {} is not in this file", n),
              "correct the dimension, or write the file again");
  }
  read_state(scan, map, static_cast<int>(n));
  read_information(scan, map, static_cast<int>(n));
  if (scan.next_line())
    scan.fail("the file goes on after the information matrix", "remove what is too much");
  return map;
}

/// What all runs of a set together say about it.
struct Shape {
  bool pose_feature = false;
  int dimension = 0;
  std::string decided_at;

  bool is_pose(const Run& run) const { return !pose_feature || run.id < 0; }
};

[[noreturn]] void fail_run(const RawMap& map, const Run& run, std::string_view problem) {
  throw InputError(
      fmt::format("{}:{}: id {} stands on {} lines in a row, but {}; check the ids of the state",
                  map.file, run.line, run.id, run.length, problem));
}

/// 2 or 3, or 0 when the run fits both.
int dimension_of(const RawMap& map, const Run& run, const Shape& shape) {
  if (shape.pose_feature) {
    if (run.id == 0) {
      throw InputError(fmt::format(
          "{}:{}: id 0 is neither a pose (negative) nor a feature (positive); number from 1",
          map.file, run.line));
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
      shape.decided_at = fmt::format("{}:{}", map.file, run.line);
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
          fmt::format("{}:{}: pose {} is in the state, but it is the reference pose itself; remove "
                      "it from the state",
                      raw.file, run.line, key.id));
    }
    if constexpr (D == 3) {
      if (angles_regularity({x[3], x[4], x[5]}) < kGimbalLock) {
        throw InputError(
            fmt::format("{}:{}: pose {} has a pitch of {} rad, where the angles of this format do "
                        "not tell yaw from "
                        "roll; use a g2o file or native maps for such data",
                        raw.file, run.line, key.id, x[4]));
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
        "'{}' holds no localmap_K.txt (K = 1, 2, ...); give the folder of a local-map set",
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
      missing += shown == 10 ? " ..." : fmt::format(" localmap_{}.txt", n);
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
  for (const LocalMapFile& file : files) raw.push_back(read_raw(file.path));
  const Shape shape = shape_of(raw);
  const auto make = [&]<int D>() -> AnyLocalMapSet {
    LocalMapSet<D> set = make_set<D>(std::move(raw), shape, options);
    set.first_number = static_cast<int>(files.front().number);
    return set;
  };
  return shape.dimension == 2 ? make.template operator()<2>() : make.template operator()<3>();
}

}  // namespace mapjoin
