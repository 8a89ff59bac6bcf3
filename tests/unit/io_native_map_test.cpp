#include "mapjoin/io/native_map.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>

#include "mapjoin/frames/anchors.h"
#include "mapjoin/io/native_layout.h"
#include "tests/support/io.h"

namespace mapjoin {
namespace {

using test::expect_input_error;

/// A type that mapjoin does not know: an offset and a drift, say, that no change of frame touches.
/// And, with another size, a type of the same name.
template <int N>
struct ClockOffset {
  static constexpr int ambient = 2;
  static constexpr int dim = N;
  static constexpr std::string_view name = "clock";
  static constexpr FrameAction action = FrameAction::kInvariant;
  template <class S>
  using Value = Vec<N, S>;
  template <class S>
  static Vec<N, S> retract(const Vec<N, S>& x, const Vec<N, S>& d) {
    return x + d;
  }
  template <class S>
  static Vec<N, S> local(const Vec<N, S>& x, const Vec<N, S>& y) {
    return y - x;
  }
  template <class S>
  static Vec<N, S> transform(const Rigid<2, S>&, const Vec<N, S>& x) {
    return x;
  }
};

template <int D>
MeasurementGraph<D> some_observations() {
  MeasurementGraphBuilder<D> builder;
  builder.template add<PoseType<D>>(pose_key(0), pose_key(1), Rigid<D>::identity(),
                                    Mat<kGauge<D>, kGauge<D>>::Identity() / 3.0);
  builder.template add<PointType<D>>(pose_key(1), point_key(9), Vec<D>::Constant(0.1),
                                     Mat<D, D>::Identity());
  LocalMap<D> map;
  map.anchor = pose_anchor<D>(pose_key(1));
  map.template add_term<PoseType<D>>(pose_key(0), Rigid<D>::identity());
  map.template add_term<PointType<D>>(point_key(3), Vec<D>::Constant(1.0 / 7.0));
  constexpr int n = kGauge<D> + D;
  map.information =
      SymmetricBlockMatrix::from_dense({0, kGauge<D>, n}, Eigen::MatrixXd::Constant(n, n, 0.1));
  builder.add(map);
  return std::move(builder).build();
}

template <int D>
Map<D> some_map() {
  ValuesBuilder<D> builder;
  Rigid<D> pose;
  pose.R = rotation_exp<D, double>(Vec<kRotation<D>>::Constant(0.3));
  pose.t.setConstant(-1.0 / 3.0);
  builder.template add<PoseType<D>>(pose_key(0), Rigid<D>::identity());
  builder.template add<PoseType<D>>(pose_key(1, 7), pose);
  builder.template add<PointType<D>>(point_key(~std::uint64_t{0}), Vec<D>::Constant(5e-324));
  Map<D> map;
  map.values = std::move(builder).build();
  const int n = map.variables().scalars();
  Eigen::MatrixXd dense(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) dense(i, j) = std::sin(i * j + 0.1) * std::pow(10.0, i + j);
  }
  dense.topRightCorner(D, kGauge<D>).setZero();
  dense.bottomLeftCorner(kGauge<D>, D).setZero();
  map.information = SymmetricBlockMatrix::from_dense(map.variables().offsets(), dense);
  map.anchor = pose_anchor<D>(pose_key(0));
  map.solved_in = pose_anchor<D>(pose_key(55));
  map.observations = std::make_shared<const MeasurementGraph<D>>(some_observations<D>());
  return map;
}

template <int D>
void expect_same_values(const Values<D>& a, const Values<D>& b) {
  ASSERT_EQ(a.variables(), b.variables());
  for (std::size_t c = 0; c < a.variables().columns().size(); ++c) {
    const auto& column = a.variables().columns()[c];
    const std::size_t bytes =
        column.keys.size() * static_cast<std::size_t>(column.kind->value_size) * sizeof(double);
    EXPECT_EQ(std::memcmp(a.data(static_cast<int>(c)), b.data(static_cast<int>(c)), bytes), 0);
  }
}

template <int D>
void expect_same_graph(const MeasurementGraph<D>& a, const MeasurementGraph<D>& b) {
  EXPECT_EQ(a.variables, b.variables);
  ASSERT_EQ(a.relative.size(), b.relative.size());
  for (std::size_t c = 0; c < a.relative.size(); ++c) {
    EXPECT_EQ(a.relative[c].kind->tag, b.relative[c].kind->tag);
    EXPECT_EQ(a.relative[c].from, b.relative[c].from);
    EXPECT_EQ(a.relative[c].to, b.relative[c].to);
    EXPECT_EQ(a.relative[c].z, b.relative[c].z);
    EXPECT_EQ(a.relative[c].info, b.relative[c].info);
  }
  EXPECT_EQ(a.submaps.anchors, b.submaps.anchors);
  EXPECT_EQ(a.submaps.anchor_start, b.submaps.anchor_start);
  EXPECT_EQ(a.submaps.anchor_variables, b.submaps.anchor_variables);
  EXPECT_EQ(a.submaps.term_start, b.submaps.term_start);
  EXPECT_EQ(a.submaps.term_variable, b.submaps.term_variable);
  EXPECT_EQ(a.submaps.term_value, b.submaps.term_value);
  EXPECT_EQ(a.submaps.values, b.submaps.values);
  EXPECT_EQ(a.submaps.block_start, b.submaps.block_start);
  EXPECT_EQ(a.submaps.block_row, b.submaps.block_row);
  EXPECT_EQ(a.submaps.block_column, b.submaps.block_column);
  EXPECT_EQ(a.submaps.block_value, b.submaps.block_value);
  EXPECT_EQ(a.submaps.information, b.submaps.information);
}

template <int D>
void expect_identical_map(const Map<D>& a, const Map<D>& b) {
  expect_same_values(a.values, b.values);
  EXPECT_EQ(a.information, b.information);
  EXPECT_EQ(a.anchor, b.anchor);
  EXPECT_EQ(a.solved_in, b.solved_in);
  ASSERT_EQ(a.observations == nullptr, b.observations == nullptr);
  if (a.observations != nullptr) expect_same_graph(*a.observations, *b.observations);
}

class NativeMap : public testing::Test {
 protected:
  std::string bytes() const { return test::read_text(path_); }
  void store(const std::string& bytes) { test::write_text(path_, bytes); }
  /// Stores bytes with size and checksum made right: what a malicious or mistaken writer would do.
  void store_sealed(std::string bytes) {
    const std::uint64_t size = bytes.size();
    std::memcpy(bytes.data() + 16, &size, 8);
    const std::uint64_t sum = detail::map_checksum(bytes);
    std::memcpy(bytes.data() + detail::kChecksumAt, &sum, 8);
    store(bytes);
  }
  void expect_refused(const std::vector<std::string>& parts) {
    std::vector<std::string> all = parts;
    all.push_back("a.map: ");
    expect_input_error([&] { read_any_map(path_); }, all);
  }

  test::TemporaryDirectory folder_;
  std::string path_ = folder_.file("a.map");
};

TEST_F(NativeMap, PlanarMapsComeBackBitForBit) {
  const Map<2> map = some_map<2>();
  write_map(path_, map);
  expect_identical_map(read_map<2>(path_), map);
  expect_identical_map(std::get<Map<2>>(read_any_map(path_)), map);
}

TEST_F(NativeMap, SpatialMapsComeBackBitForBit) {
  const Map<3> map = some_map<3>();
  write_map(path_, map);
  expect_identical_map(read_map<3>(path_), map);
  expect_identical_map(std::get<Map<3>>(read_any_map(path_)), map);
}

TEST_F(NativeMap, SummariesAndEmptyMapsComeBack) {
  Map<2> map = some_map<2>();
  map.observations = nullptr;
  write_map(path_, map);
  expect_identical_map(read_map<2>(path_), map);
  write_map(path_, Map<2>{});
  expect_identical_map(read_map<2>(path_), Map<2>{});
}

TEST_F(NativeMap, EqualMapsAreEqualFiles) {
  write_map(path_, some_map<2>());
  write_map(folder_.file("b.map"), read_map<2>(path_));
  EXPECT_EQ(bytes(), test::read_text(folder_.file("b.map")));
}

Map<2> map_with_clock() {
  ValuesBuilder<2> builder;
  builder.add<Pose2>(pose_key(0), Rigid2::identity());
  builder.add<ClockOffset<2>>({Tag("clock"), 0, 4}, Vec<2>(0.25, 1e-9));
  Map<2> map;
  map.values = std::move(builder).build();
  map.information =
      SymmetricBlockMatrix::from_dense(map.variables().offsets(), Eigen::MatrixXd::Identity(5, 5));
  map.anchor = map.solved_in = pose_anchor<2>(pose_key(0));
  return map;
}

TEST_F(NativeMap, TypesOfAUsersOwnComeBack) {
  write_map(path_, map_with_clock());
  KnownTypes<2> types = builtin_types<2>();
  types.add<ClockOffset<2>>();
  expect_identical_map(read_map<2>(path_, types), map_with_clock());
}

TEST_F(NativeMap, TypesThatAreNotRegisteredAreNamed) {
  write_map(path_, map_with_clock());
  expect_refused({"type 'clock' (dimension 2), which is not registered", "types.add<YourType>()"});
}

TEST_F(NativeMap, TypesThatChangedAreNamed) {
  write_map(path_, map_with_clock());
  KnownTypes<2> types = builtin_types<2>();
  types.add<ClockOffset<3>>();
  expect_input_error(
      [&] { read_map<2>(path_, types); },
      {"type 'clock' has dimension 2 and 2 numbers a value, in this program 3 and 3"});
}

TEST_F(NativeMap, AnchorsThatAreNotRegisteredAreNamed) {
  write_map(path_, some_map<2>());
  KnownTypes<2> types = builtin_types<2>();
  types.anchors.clear();
  expect_input_error([&] { read_map<2>(path_, types); },
                     {"anchored by 'pose' with 1 variables, which is not registered"});
}

TEST_F(NativeMap, TheOtherDimensionIsRefused) {
  write_map(path_, some_map<2>());
  expect_input_error([&] { read_map<3>(path_); }, {"this map is 2D, but a 3D map is wanted"});
}

TEST_F(NativeMap, OtherFilesAreRefused) {
  store("EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n");
  expect_refused({"not a native map"});
  store("");
  expect_refused({"not a native map"});
}

TEST_F(NativeMap, TruncationIsRefused) {
  write_map(path_, some_map<2>());
  const std::string whole = bytes();
  for (std::size_t size = 1; size < whole.size(); size += size < 64 ? 1 : 37) {
    store(whole.substr(0, size));
    EXPECT_THROW(read_any_map(path_), InputError) << size;
  }
  store(whole.substr(0, whole.size() - 1));
  expect_refused({"but its header says", "copy or write it again"});
}

TEST_F(NativeMap, ChangedBytesAreNoticed) {
  write_map(path_, some_map<2>());
  const std::string whole = bytes();
  for (std::size_t at = 0; at < whole.size(); at += at < 300 ? 1 : 23) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    store(damaged);
    EXPECT_THROW(read_any_map(path_), InputError) << at;
  }
}

TEST_F(NativeMap, ChangedContentIsSaidToBeSo) {
  write_map(path_, some_map<2>());
  std::string damaged = bytes();
  damaged[damaged.size() / 2] ^= 1;
  store(damaged);
  expect_refused({"the checksum does not match the content"});
}

TEST_F(NativeMap, LaterVersionsAreRefused) {
  write_map(path_, some_map<2>());
  std::string later = bytes();
  later[8] = 9;
  store_sealed(later);
  expect_refused({"format version 9, but this mapjoin reads version 1"});
}

TEST_F(NativeMap, SealedNonsenseNeverCrashes) {
  // Words of the file in turn replaced by something hostile, the checksum made right
  // again.
  write_map(path_, some_map<2>());
  const std::string whole = bytes();
  for (const std::uint64_t hostile :
       {~std::uint64_t{0}, std::uint64_t{1} << 60U, std::uint64_t{0}, std::uint64_t{1},
        std::uint64_t{0x7fffffff7fffffff}, std::uint64_t{0x8000000080000000}}) {
    for (std::size_t at = detail::kHeaderSize; at + 8 <= whole.size(); at += at < 400 ? 8 : 40) {
      std::string damaged = whole;
      std::memcpy(damaged.data() + at, &hostile, 8);
      store_sealed(damaged);
      try {
        read_any_map(path_);
      } catch (const InputError&) {
      }
    }
  }
}

TEST_F(NativeMap, HugeCountsAreRefusedBeforeAnythingIsAllocated) {
  write_map(path_, some_map<2>());
  std::string damaged = bytes();
  // The first array of the section "inform", the second in the table after "types" and "values".
  std::uint64_t at = 0;
  std::memcpy(&at, damaged.data() + detail::kHeaderSize + 8 + 2 * 32 + 16, 8);
  const std::uint64_t count = std::uint64_t{1} << 58U;
  std::memcpy(damaged.data() + at, &count, 8);
  store_sealed(damaged);
  expect_refused({"section 'inform', byte 8: offsets is said to have 288230376151711744 entries"});
}

TEST_F(NativeMap, UnknownSectionsArePassedOverUnlessRequired) {
  // A file as a later release might write it: one more section, its entry at the end of the table.
  const Map<2> map = some_map<2>();
  write_map(path_, map);
  std::string file = bytes();
  std::uint64_t count = 0;
  std::memcpy(&count, file.data() + detail::kHeaderSize, 8);
  const std::size_t table_end = detail::kHeaderSize + 8 + 32 * count;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t at = detail::kHeaderSize + 8 + 32 * k + 16;
    std::uint64_t offset = 0;
    std::memcpy(&offset, file.data() + at, 8);
    offset += 32;
    std::memcpy(file.data() + at, &offset, 8);
  }
  ByteWriter entry;
  entry.tag("newthing");
  entry.number(std::uint64_t{0});
  entry.number(std::uint64_t{file.size() + 32});
  entry.number(std::uint64_t{8});
  file.insert(table_end, entry.bytes());
  file += std::string(8, 'x');
  ++count;
  std::memcpy(file.data() + detail::kHeaderSize, &count, 8);
  store_sealed(file);
  expect_identical_map(read_map<2>(path_), map);

  file[table_end + 8] = 1;
  store_sealed(file);
  expect_refused({"the section 'newthing' is needed", "later mapjoin"});
}

TEST_F(NativeMap, MissingSectionsAreNamed) {
  write_map(path_, some_map<2>());
  std::string file = bytes();
  const std::size_t at = file.find("anchors", detail::kHeaderSize);
  file[at] = 'b';
  file[at + 8] = 0;
  store_sealed(file);
  expect_refused({"the section 'anchors' is missing"});
}

}  // namespace
}  // namespace mapjoin
