#include "mapjoin/evaluation/simulated_path.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "mapjoin/evaluation/random.h"

namespace mapjoin {

namespace {

constexpr int kMaxClosures = 4;        // to one pose
constexpr int kMinGap = 10;            // poses closer in time than this close no loop
constexpr int kRemembered = 16;        // poses looked at in a cell, latest first
constexpr double kVisitsOfStreet = 2;  // on average, where the size of the world is ours to choose

// Between two crossings, metres; poses stand one metre apart.
template <int D>
constexpr int kBlock = D == 2 ? 5 : 3;

/// Spends `rate` loop closures a pose on average. What a pose finds no use for is saved, so that
/// closures are denser where the path runs along an old one.
class Allowance {
 public:
  explicit Allowance(double rate) : rate_(rate), most_(static_cast<int>(std::ceil(rate)) + 1) {}
  void next_pose() {
    credit_ += rate_;
    spent_ = 0;
  }
  bool any() const { return credit_ >= 1.0 && spent_ < most_; }
  void spend() {
    credit_ -= 1.0;
    ++spent_;
  }

 private:
  double rate_;
  int most_;  // at one pose: 4 for the highest rate
  double credit_ = 0.0;
  int spent_ = 0;
};

/// Poses by the cell they stand in: chains of indices, latest first, in a hash table.
template <int D>
class PosesByCell {
 public:
  explicit PosesByCell(std::size_t poses)
      : head_(std::bit_ceil(2 * poses + 1), -1), next_(poses, -1), cells_(poses) {}

  void add(std::int32_t pose, const Cell<D>& cell) {
    std::int32_t& head = head_[hash_of<D>(cell) & (head_.size() - 1)];
    cells_[static_cast<std::size_t>(pose)] = cell;
    next_[static_cast<std::size_t>(pose)] = head;
    head = pose;
  }
  /// Appends the latest poses in a cell that are not later than `until`.
  void find(const Cell<D>& cell, std::int32_t until, std::vector<std::int32_t>& out) const {
    std::int32_t i = head_[hash_of<D>(cell) & (head_.size() - 1)];
    for (int seen = 0; i >= 0 && seen < kRemembered;
         i = next_[static_cast<std::size_t>(i)], ++seen) {
      if (i <= until && cells_[static_cast<std::size_t>(i)] == cell) out.push_back(i);
    }
  }

 private:
  std::vector<std::int32_t> head_;
  std::vector<std::int32_t> next_;
  std::vector<Cell<D>> cells_;
};

/// Finds loop closures between poses in the same or in neighbouring cells.
template <int D>
class ClosureFinder {
 public:
  ClosureFinder(const SimulationOptions& options, std::size_t poses)
      : allowance_(options.edges_per_pose - 1.0),
        random_(options.seed, 2),
        places_(poses),
        degree_(poses, 0) {}

  void visit(std::int32_t pose, const Cell<D>& cell, SimulatedPath<D>& path) {
    allowance_.next_pose();
    if (allowance_.any() && pose >= kMinGap) {
      candidates_.clear();
      look(cell, pose - kMinGap);
      while (allowance_.any() && !candidates_.empty()) {
        const auto at =
            static_cast<std::size_t>(random_.below(static_cast<int>(candidates_.size())));
        const std::int32_t other = candidates_[at];
        candidates_[at] = candidates_.back();
        candidates_.pop_back();
        if (degree_[static_cast<std::size_t>(other)] >= kMaxClosures) continue;
        ++degree_[static_cast<std::size_t>(other)];
        path.closures.emplace_back(pose, other);
        allowance_.spend();
      }
    }
    places_.add(pose, cell);
  }

 private:
  void look(const Cell<D>& cell, std::int32_t until) {
    places_.find(cell, until, candidates_);
    for (std::size_t k = 0; k < static_cast<std::size_t>(D); ++k) {
      for (const int step : {-1, 1}) {
        Cell<D> beside = cell;
        beside[k] += step;
        places_.find(beside, until, candidates_);
      }
    }
  }

  Allowance allowance_;
  Random random_;
  PosesByCell<D> places_;
  std::vector<std::uint8_t> degree_;
  std::vector<std::int32_t> candidates_;
};

/// Blocks a side. A world of B blocks has about D B^D streets of one block's length.
template <int D>
int blocks_of(const SimulationOptions& options) {
  const double block = kBlock<D>;
  const double n = static_cast<double>(options.poses);
  double blocks = options.world_size / block;
  if (options.world_size == 0.0) blocks = std::pow(n / (kVisitsOfStreet * D * block), 1.0 / D);
  return static_cast<int>(std::clamp(std::round(blocks), 1.0, 1e8));
}

template <int D>
using Turn = Eigen::Matrix<int, D, D>;

/// Straight on (as often as all turns together in the plane, a third of the time in space), left,
/// right, and in space up and down.
template <int D>
Turn<D> draw_turn(Random& random) {
  Turn<D> turn = Turn<D>::Identity();
  const int choice = random.below(D == 2 ? 4 : 6) - 2;
  if (choice < 0) return turn;
  const int sign = choice % 2 == 0 ? 1 : -1;
  const int axis = choice < 2 ? 1 : D - 1;  // towards which the first axis, ahead, turns
  turn(0, 0) = turn(axis, axis) = 0;
  turn(axis, 0) = sign;
  turn(0, axis) = -sign;
  return turn;
}

}  // namespace

template <int D>
SimulatedPath<D> drive_streets(const SimulationOptions& options) {
  const auto n = static_cast<std::size_t>(options.poses);
  const int side = blocks_of<D>(options) * kBlock<D>;
  Random random(options.seed, 1);
  ClosureFinder<D> closures(options, n);
  SimulatedPath<D> path;
  path.poses.reserve(n);

  Eigen::Matrix<int, D, 1> at =
      Eigen::Matrix<int, D, 1>::Constant(side / 2 / kBlock<D> * kBlock<D>);
  const Eigen::Matrix<int, D, 1> start = at;
  Turn<D> heading = Turn<D>::Identity();
  const auto leaves = [&](const Turn<D>& h) {
    const Eigen::Matrix<int, D, 1> next = at + h.col(0);
    return next.minCoeff() < 0 || next.maxCoeff() > side;
  };
  for (std::size_t i = 0; i < n; ++i) {
    Rigid<D> pose;
    pose.R = heading.template cast<double>();
    pose.t = (at - start).template cast<double>();
    path.poses.push_back(pose);
    Cell<D> cell;
    std::copy(at.data(), at.data() + D, cell.begin());
    closures.visit(static_cast<std::int32_t>(i), cell, path);

    const bool crossing = at.unaryExpr([](int x) { return x % kBlock<D>; }).isZero();
    Turn<D> next = heading;
    if (crossing) {
      do {
        next = heading * draw_turn<D>(random);
      } while (leaves(next));
    }
    heading = next;
    at += heading.col(0);
  }
  return path;
}

SimulatedPath<3> fly_sphere(const SimulationOptions& options) {
  const auto n = static_cast<std::int32_t>(options.poses);
  const auto ring =
      static_cast<std::int32_t>(std::max(4.0, std::round(std::sqrt(static_cast<double>(n)))));
  const double radius =
      options.world_size > 0.0 ? options.world_size : ring / (2 * std::numbers::pi);
  Allowance allowance(options.edges_per_pose - 1.0);
  SimulatedPath<3> path;
  path.poses.reserve(static_cast<std::size_t>(n));
  for (std::int32_t i = 0; i < n; ++i) {
    const double azimuth = 2 * std::numbers::pi * i / ring;
    const double elevation = std::numbers::pi * ((i + 0.5) / n - 0.5);
    const Eigen::Vector3d out(std::cos(elevation) * std::cos(azimuth),
                              std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
    Rigid3 pose;  // ahead along the ring, up away from the centre
    pose.t = radius * out;
    pose.R.col(0) = Eigen::Vector3d(-std::sin(azimuth), std::cos(azimuth), 0.0);
    pose.R.col(2) = out;
    pose.R.col(1) = Eigen::Vector3d(pose.R.col(2)).cross(Eigen::Vector3d(pose.R.col(0)));
    path.poses.push_back(pose);

    allowance.next_pose();
    for (const std::int32_t back : {ring, ring + 1, ring - 1}) {
      if (i < back || !allowance.any()) break;
      path.closures.emplace_back(i, i - back);
      allowance.spend();
    }
  }
  const Rigid3 into_first = path.poses.front().inverse();
  for (Rigid3& pose : path.poses) pose = into_first * pose;
  return path;
}

template SimulatedPath<2> drive_streets<2>(const SimulationOptions&);
template SimulatedPath<3> drive_streets<3>(const SimulationOptions&);

}  // namespace mapjoin
