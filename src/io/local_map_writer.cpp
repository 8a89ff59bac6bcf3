#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "mapjoin/graph/error.h"
#include "mapjoin/io/atomic_file.h"
#include "mapjoin/io/euler_chart.h"
#include "mapjoin/io/local_map_files.h"
#include "mapjoin/io/local_maps.h"

namespace mapjoin {

namespace {

namespace fs = std::filesystem;

std::string file_name(std::int64_t number) { return fmt::format("localmap_{}.txt", number); }

template <int D>
class MapText {
 public:
  MapText(const LocalMap<D>& map, bool pose_feature, std::string name)
      : map_(map),
        pose_feature_(pose_feature),
        name_(std::move(name)),
        information_(map.information.dense()) {}

  std::string text() && {
    check_anchor();
    const int n = map_.information.scalars();
    out_ = fmt::format("{}\n{}\n", map_.anchor.keys[0].id, n);
    const double* x = map_.values.data();
    for (std::size_t k = 0; k < map_.keys.size(); ++k) {
      check_term(k);
      append_term(static_cast<int>(k), x);
      x += map_.kinds[k]->value_size;
    }
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) append("{}{}", j == 0 ? "" : " ", information_(i, j));
      out_ += '\n';
    }
    return std::move(out_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format(
        "{}: the local-map text format cannot say {}; write native maps instead", name_, what));
  }
  bool is_pose(std::size_t k) const { return map_.keys[k].type == Tag("pose"); }

  void check_anchor() const {
    if (map_.anchor.keys.size() != 1 || map_.anchor.keys[0].type != Tag("pose"))
      fail("an anchor that is not one pose");
    if (map_.keys.empty()) fail("a map without variables");
  }
  void check_term(std::size_t k) const {
    const Key& key = map_.keys[k];
    if (!is_pose(k) && key.type != Tag("point"))
      fail(fmt::format("{}, neither a pose nor a point", to_string(key)));
    if (key.session != map_.anchor.keys[0].session)
      fail(fmt::format("{}, of another session than the anchor", to_string(key)));
    if (key == map_.anchor.keys[0])
      fail(fmt::format("{}, the anchor itself, as a variable", to_string(key)));
    if (!is_pose(k) && !pose_feature_)
      fail(fmt::format("the feature {} in a pose-only set", to_string(key)));
    if (pose_feature_ && key.id == 0)
      fail(fmt::format("{} in a pose-feature set: signs tell poses from features", to_string(key)));
    if (pose_feature_ && k > 0 && key == map_.keys[k - 1])
      fail(fmt::format("{} twice in a row in a pose-feature set", to_string(key)));
  }

  void append_term(int term, const double* x) {
    const auto k = static_cast<std::size_t>(term);
    const bool negative = pose_feature_ && is_pose(k);
    const auto append_number = [&](double value) {
      append("{}{} {}\n", negative ? "-" : "", map_.keys[k].id, value);
    };
    if (!is_pose(k)) {
      for (int i = 0; i < D; ++i) append_number(x[i]);
      return;
    }
    const auto& pose = *reinterpret_cast<const Rigid<D>*>(x);
    const Twist<D> numbers = file_coordinates<D>(pose);
    for (const double value : numbers) append_number(value);
    // I_file = B^-T I B^-1.
    constexpr int N = kGauge<D>;
    const int at = map_.information.offset(term);
    const Eigen::Matrix<double, N, N> inverse =
        inverse_file_chart_jacobian<D>(pose, numbers.data());
    const Eigen::Matrix<double, Eigen::Dynamic, N> columns =
        information_.template middleCols<N>(at) * inverse;
    information_.template middleCols<N>(at) = columns;
    const Eigen::Matrix<double, N, Eigen::Dynamic> rows =
        inverse.transpose() * information_.template middleRows<N>(at);
    information_.template middleRows<N>(at) = rows;
  }

  template <class... Args>
  void append(fmt::format_string<Args...> format, Args&&... args) {
    out_ += fmt::format(format, std::forward<Args>(args)...);
  }

  const LocalMap<D>& map_;
  bool pose_feature_;
  std::string name_;
  Eigen::MatrixXd information_;
  std::string out_;
};

void prepare_folder(const fs::path& folder, std::int64_t first, std::int64_t count) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error)
    throw FileError(fmt::format("cannot create folder '{}': {}", folder.string(), error.message()));
  for (const detail::LocalMapFile& file : detail::local_map_files(folder)) {
    const bool ours = file.number >= first && file.number < first + count &&
                      file.path.filename() == file_name(file.number);
    if (ours) continue;
    throw InputError(fmt::format(
        "'{}' is not of the set that is to be written beside it; choose an empty folder",
        file.path.string()));
  }
}

}  // namespace

template <int D>
void write_local_maps(const fs::path& folder, const LocalMapSet<D>& set) {
  // All texts first: what cannot be said is found before anything is written.
  std::vector<std::string> texts;
  texts.reserve(set.maps.size());
  for (const LocalMap<D>& map : set.maps) {
    const std::string name = file_name(set.first_number + std::ssize(texts));
    texts.push_back(MapText<D>(map, set.pose_feature, name).text());
  }
  prepare_folder(folder, set.first_number, std::ssize(texts));
  std::int64_t number = set.first_number;
  for (const std::string& text : texts) write_atomically(folder / file_name(number++), text);
}

template void write_local_maps<2>(const fs::path&, const LocalMapSet<2>&);
template void write_local_maps<3>(const fs::path&, const LocalMapSet<3>&);

}  // namespace mapjoin
