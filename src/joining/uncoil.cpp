#include "mapjoin/joining/uncoil.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/graph/disjoint_sets.h"
#include "mapjoin/graph/rotation.h"

namespace mapjoin {

namespace {

constexpr double kStrained = 0.2;             // rad
constexpr double kCoiled = std::numbers::pi;  // rad, sum over a chain

/// A relative measurement, by the places of its variables in the piece.
template <int D>
struct Link {
  const RelativeMeasurements<D>* column = nullptr;
  std::size_t k = 0;  ///< in the column
  int from = 0, to = 0;

  const double* z() const {
    return column->z.data() + k * static_cast<std::size_t>(column->kind->value_size);
  }
};

/// Calls f(link) for all relative measurements among some of a piece; places must be marked.
template <int D, class F>
void for_each_link(const MeasurementGraph<D>& graph, std::span<const std::int64_t> observations,
                   const Places& places, F&& f) {
  std::vector<std::int64_t> first{0};
  for (const auto& column : graph.relative)
    first.push_back(first.back() + static_cast<std::int64_t>(column.size()));
  for (const std::int64_t o : observations) {
    if (o >= first.back()) continue;
    std::size_t c = 0;
    while (o >= first[c + 1]) ++c;
    Link<D> link{&graph.relative[c], static_cast<std::size_t>(o - first[c])};
    link.from = places[link.column->from[link.k]];
    link.to = places[link.column->to[link.k]];
    f(link);
  }
}

/// The poses of a piece.
template <int D>
class Poses {
 public:
  Poses(const VariableSet<D>& all, const Piece<D>& piece)
      : column_(all.find_column(Tag("pose"))), piece_(&piece) {}

  bool none() const { return column_ < 0; }
  const Rigid<D>& operator[](int place) const {
    const auto c = static_cast<std::size_t>(column_);
    return reinterpret_cast<const Rigid<D>*>(
        piece_->data[c].data())[place - piece_->column_start[c]];
  }

 private:
  int column_;
  const Piece<D>* piece_;
};

struct Strained {
  int a, b;
  double angle;
};

template <int D>
std::vector<Strained> strained_links(const MeasurementGraph<D>& graph, const Piece<D>& piece,
                                     std::span<const std::int64_t> observations,
                                     const Places& places) {
  const Poses<D> pose(graph.variables, piece);
  const double least_trace = D - 2 + 2.0 * std::cos(kStrained);
  std::vector<Strained> out;
  if (pose.none()) return out;
  for_each_link(graph, observations, places, [&](const Link<D>& link) {
    if (link.column->kind != &kind_of<PoseType<D>>()) return;
    const Rigid<D>& z = *reinterpret_cast<const Rigid<D>*>(link.z());
    const Mat<D, D> between = pose[link.from].R.transpose() * pose[link.to].R;
    if (z.R.cwiseProduct(between).sum() > least_trace) return;  // the trace of z^T between
    out.push_back({link.from, link.to, rotation_log<D, double>(z.R.transpose() * between).norm()});
  });
  return out;
}

/// Those of all its observations, in their order: each thread looks at a stretch.
template <int D>
std::vector<Strained> strained_links(const MeasurementGraph<D>& graph, const Piece<D>& piece,
                                     const Places& places, WorkerPool& pool) {
  const auto threads = static_cast<std::size_t>(pool.threads());
  const std::span<const std::int64_t> all = piece.observations;
  const std::size_t stretch = all.size() / threads + 1;
  std::vector<std::vector<Strained>> found(threads);
  pool.run([&](int thread) {
    const auto t = static_cast<std::size_t>(thread);
    const std::size_t begin = std::min(all.size(), t * stretch);
    found[t] = strained_links(graph, piece,
                              all.subspan(begin, std::min(stretch, all.size() - begin)), places);
  });
  for (std::size_t t = 1; t < threads; ++t)
    found[0].insert(found[0].end(), found[t].begin(), found[t].end());
  return std::move(found[0]);
}

}  // namespace

template <int D>
std::vector<int> coiled_poses(const MeasurementGraph<D>& graph, const Piece<D>& piece,
                              Places& places, WorkerPool& pool) {
  places.mark(piece.variables);
  const std::vector<Strained> strained = strained_links(graph, piece, places, pool);
  places.clear(piece.variables);

  std::vector<int> poses;
  for (const Strained& s : strained) poses.insert(poses.end(), {s.a, s.b});
  std::sort(poses.begin(), poses.end());
  poses.erase(std::unique(poses.begin(), poses.end()), poses.end());
  const auto number = [&](int place) {
    return static_cast<int>(std::lower_bound(poses.begin(), poses.end(), place) - poses.begin());
  };
  DisjointSets chains(static_cast<int>(poses.size()));
  for (const Strained& s : strained) chains.unite(number(s.a), number(s.b));
  std::vector<double> turned(poses.size(), 0.0);
  for (const Strained& s : strained)
    turned[static_cast<std::size_t>(chains.root(number(s.a)))] += s.angle;

  std::vector<int> out;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const int root = chains.root(static_cast<int>(k));
    if (turned[static_cast<std::size_t>(root)] > kCoiled) out.push_back(poses[k]);
  }
  return out;
}

template <int D>
void lay_anew(const MeasurementGraph<D>& graph, Piece<D>& piece, Places& places,
              const std::vector<int>& poses) {
  const VariableSet<D>& all = graph.variables;
  std::vector<char> laid(static_cast<std::size_t>(piece.size()), 1);
  const auto is_laid = [&](int place) -> char& { return laid[static_cast<std::size_t>(place)]; };
  for (const int p : poses) is_laid(p) = 0;

  // What touches the poses in question, and what else sees their targets.
  std::vector<Link<D>> between, sights;
  std::vector<char> seen_elsewhere(static_cast<std::size_t>(piece.size()), 0);
  places.mark(piece.variables);
  for_each_link(graph, std::span(piece.observations), places, [&](const Link<D>& link) {
    if (link.column->kind == &kind_of<PoseType<D>>()) {
      if (is_laid(link.from) == 0 || is_laid(link.to) == 0) between.push_back(link);
    } else if (is_laid(link.from) == 0) {
      sights.push_back(link);
    } else {
      seen_elsewhere[static_cast<std::size_t>(link.to)] = 1;
    }
  });
  places.clear(piece.variables);

  // Ring by ring, from what is laid.
  const auto pose = [&](int place) {
    return reinterpret_cast<Rigid<D>*>(value_of(all, piece, place));
  };
  for (bool more = true; more;) {
    std::vector<int> ring;
    for (const Link<D>& link : between) {
      if ((is_laid(link.from) == 1) == (is_laid(link.to) == 1)) continue;
      const Rigid<D>& z = *reinterpret_cast<const Rigid<D>*>(link.z());
      const bool forward = is_laid(link.from) == 1;
      const int next = forward ? link.to : link.from;
      if (is_laid(next) == 2) continue;  // in this ring already
      *pose(next) = forward ? *pose(link.from) * z : *pose(link.to) * z.inverse();
      is_laid(next) = 2;
      ring.push_back(next);
    }
    for (const int p : ring) is_laid(p) = 1;
    more = !ring.empty();
  }

  for (const Link<D>& link : sights) {
    char& elsewhere = seen_elsewhere[static_cast<std::size_t>(link.to)];
    if (elsewhere != 0 || is_laid(link.from) == 0) continue;
    elsewhere = 1;
    const VariableKind<D>& kind = *link.column->kind;
    double* const x = value_of(all, piece, link.to);
    std::copy_n(link.z(), kind.value_size, x);
    kind.transform(*pose(link.from), x, 1);
  }
}

#define MAPJOIN_INSTANTIATE(D)                                                                    \
  template std::vector<int> coiled_poses<D>(const MeasurementGraph<D>&, const Piece<D>&, Places&, \
                                            WorkerPool&);                                         \
  template void lay_anew<D>(const MeasurementGraph<D>&, Piece<D>&, Places&,                       \
                            const std::vector<int>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
