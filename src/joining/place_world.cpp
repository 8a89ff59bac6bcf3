#include "mapjoin/joining/place_world.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "mapjoin/frames/align.h"
#include "mapjoin/graph/symmetric.h"
#include "mapjoin/graph/world.h"
#include "mapjoin/joining/place.h"

namespace mapjoin {

namespace {

constexpr double kKnownRotation = 1.0;    // 1/rad^2
constexpr double kKnownDirection = 1e-9;  // of the information on the best known direction

/// What a measurement of a pose says on its own.
template <int D>
struct Knows {
  bool position = false;
  bool rotation = false;
};
template <int D>
Knows<D> knows(const double* information) {
  const Eigen::Map<const Mat<kGauge<D>, kGauge<D>>> info(information);
  const Eigen::VectorXd t = eigenvalues(info.template topLeftCorner<D, D>());
  const Eigen::VectorXd r =
      eigenvalues(info.template bottomRightCorner<kRotation<D>, kRotation<D>>());
  return {t(0) > kKnownDirection * t(D - 1), r(0) >= kKnownRotation};
}

/// The measurements of poses, the number of the first, and the number of the world.
template <int D>
struct FromWorld {
  const RelativeMeasurements<D>* poses = nullptr;
  std::int64_t first = 0;
  int world = -1;
};
template <int D>
FromWorld<D> from_world(const MeasurementGraph<D>& graph) {
  FromWorld<D> out;
  const auto world = graph.variables.find(world_key());
  if (!world) return out;
  out.world = *world;
  for (const RelativeMeasurements<D>& column : graph.relative) {
    if (column.kind->tag == Tag("pose")) {
      out.poses = &column;
      break;
    }
    out.first += static_cast<std::int64_t>(column.size());
  }
  return out;
}

/// Partial measurements of the poses of one piece.
struct Fixes {
  std::vector<std::int64_t> observations;
  std::vector<int> places;  ///< of the poses, in the piece
};

template <int D>
std::vector<Fixes> fixes_of_pieces(const FromWorld<D>& from, std::span<const std::int64_t> partial,
                                   const std::vector<Piece<D>>& pieces) {
  std::vector<Fixes> out(pieces.size());
  for (const std::int64_t o : partial) {
    const int pose = from.poses->to[static_cast<std::size_t>(o - from.first)];
    for (std::size_t p = 0; p < pieces.size(); ++p) {
      const auto& all = pieces[p].variables;
      const auto at = std::lower_bound(all.begin(), all.end(), pose);
      if (at == all.end() || *at != pose) continue;
      out[p].observations.push_back(o);
      out[p].places.push_back(static_cast<int>(at - all.begin()));
    }
  }
  return out;
}

/// The motion of a piece into the frame of the world.
template <int D>
std::optional<Rigid<D>> fit(const MeasurementGraph<D>& graph, const FromWorld<D>& from,
                            const Piece<D>& at_world, Piece<D>& piece, const Fixes& fixes) {
  CommonGeometry<D> common =
      common_geometry(to_values(graph.variables, at_world), to_values(graph.variables, piece));
  for (std::size_t f = 0; f < fixes.observations.size(); ++f) {
    const auto row = static_cast<std::size_t>(fixes.observations[f] - from.first);
    const auto known = knows<D>(from.poses->info.data() + row * kGauge<D> * kGauge<D>);
    const auto& z = reinterpret_cast<const Rigid<D>*>(from.poses->z.data())[row];
    const auto& x =
        *reinterpret_cast<const Rigid<D>*>(value_of(graph.variables, piece, fixes.places[f]));
    if (known.position) common.positions.add(z.t.data(), x.t.data());
    if (known.rotation) common.rotations.add(z.R.data(), x.R.data());
  }
  return align(common);
}

}  // namespace

template <int D>
std::vector<std::int64_t> partial_world_measurements(const MeasurementGraph<D>& graph) {
  std::vector<std::int64_t> out;
  const FromWorld<D> from = from_world(graph);
  if (from.poses == nullptr) return out;
  for (std::size_t k = 0; k < from.poses->size(); ++k) {
    if (from.poses->from[k] != from.world) continue;
    const auto known = knows<D>(from.poses->info.data() + k * kGauge<D> * kGauge<D>);
    if (!known.position || !known.rotation)
      out.push_back(from.first + static_cast<std::int64_t>(k));
  }
  return out;
}

template <int D>
std::vector<Piece<D>> place_in_world(const MeasurementGraph<D>& graph,
                                     const std::vector<std::int64_t>& partial,
                                     std::vector<Piece<D>> pieces,
                                     std::vector<std::string>& notes) {
  const VariableSet<D>& all = graph.variables;
  const FromWorld<D> from = from_world(graph);
  const auto holds_world = [&](const Piece<D>& piece) {
    return std::binary_search(piece.variables.begin(), piece.variables.end(), from.world);
  };
  // The piece of the world comes first: the one that holds it, or the world alone, at the identity.
  const auto at_world = std::find_if(pieces.begin(), pieces.end(), holds_world);
  if (at_world == pieces.end()) {
    Piece<D> alone = make_piece(all, {from.world});
    *reinterpret_cast<Rigid<D>*>(value_of(all, alone, 0)) = Rigid<D>::identity();
    pieces.insert(pieces.begin(), std::move(alone));
  } else {
    std::rotate(pieces.begin(), at_world, at_world + 1);
    Piece<D>& first = pieces[0];
    const auto at = std::lower_bound(first.variables.begin(), first.variables.end(), from.world);
    const Rigid<D> world = *reinterpret_cast<const Rigid<D>*>(
        value_of(all, first, static_cast<int>(at - first.variables.begin())));
    move(all, first, world.inverse());
  }

  const std::vector<Fixes> fixes = fixes_of_pieces(from, partial, pieces);
  std::vector<int> placed{0};
  std::vector<Piece<D>> out;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    if (p > 0) {
      const auto T = fit(graph, from, pieces[0], pieces[p], fixes[p]);
      if (!T) {
        if (!fixes[p].observations.empty())
          notes.push_back(fmt::format(
              "{} measurement{} from the world do{} not say where the piece of {} lies in it, and "
              "{} left out: {}",
              fixes[p].observations.size(), fixes[p].observations.size() == 1 ? "" : "s",
              fixes[p].observations.size() == 1 ? "es" : "",
              to_string(all.key(pieces[p].variables[0])),
              fixes[p].observations.size() == 1 ? "is" : "are",
              D == 2 ? "it takes two positions, or one and an orientation"
                     : "it takes three positions that are not on one line, or one and an "
                       "orientation"));
        out.push_back(std::move(pieces[p]));
        continue;
      }
      move(all, pieces[p], *T);
      placed.push_back(static_cast<int>(p));
    }
    auto& observations = pieces[p].observations;
    observations.insert(observations.end(), fixes[p].observations.begin(),
                        fixes[p].observations.end());
  }
  // A world that nothing was placed in is no map.
  if (placed.size() > 1 || !pieces[0].observations.empty())
    out.insert(out.begin(), unite(all, pieces, placed));
  return out;
}

#define MAPJOIN_INSTANTIATE(D)                                                                  \
  template std::vector<std::int64_t> partial_world_measurements<D>(const MeasurementGraph<D>&); \
  template std::vector<Piece<D>> place_in_world<D>(                                             \
      const MeasurementGraph<D>&, const std::vector<std::int64_t>&, std::vector<Piece<D>>,      \
      std::vector<std::string>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
