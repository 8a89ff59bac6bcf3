#include "mapjoin/joining/leaf.h"

#include <algorithm>
#include <cstring>

#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

/// Lays out one leaf. Values live in `scratch`, a piece over all variables of the leaf, while a
/// piece grows.
template <int D>
class LeafGrower {
 public:
  LeafGrower(const MeasurementGraph<D>& graph, std::span<const std::int64_t> observations,
             Places& places)
      : graph_(graph), all_(graph.variables), observations_(observations), places_(places) {
    pose_column_ = all_.find_column(Tag("pose"));
    collect_variables();
    collect_incidence();
  }
  ~LeafGrower() { places_.clear(scratch_.variables); }
  LeafGrower(const LeafGrower&) = delete;
  LeafGrower& operator=(const LeafGrower&) = delete;

  std::vector<Piece<D>> grow() {
    std::vector<Piece<D>> out;
    if (pose_column_ >= 0) {
      const int end = scratch_.column_start[static_cast<std::size_t>(pose_column_) + 1];
      for (int k = scratch_.column_start[static_cast<std::size_t>(pose_column_)]; k < end; ++k) {
        if (stamp_[at(k)] < 0) out.push_back(grow_from(k, static_cast<int>(out.size())));
      }
    }
    for (std::size_t o = 0; o < observations_.size(); ++o) {
      if (!used_[o]) out.push_back(alone(o, static_cast<int>(out.size())));
    }
    return out;
  }

 private:
  struct Located {  // an observation: which relative column and row, or which submap
    const RelativeMeasurements<D>* column = nullptr;
    std::size_t row = 0;
  };
  Located locate(std::int64_t observation) const {
    for (const auto& column : graph_.relative) {
      if (observation < static_cast<std::int64_t>(column.size())) return {&column, at(observation)};
      observation -= static_cast<std::int64_t>(column.size());
    }
    return {nullptr, at(observation)};
  }

  template <class F>
  void for_variables(const Located& here, F&& f) const {
    if (here.column != nullptr) {
      f(here.column->from[here.row]);
      f(here.column->to[here.row]);
      return;
    }
    const auto& maps = graph_.submaps;
    for (auto a = maps.anchor_start[here.row]; a < maps.anchor_start[here.row + 1]; ++a)
      f(maps.anchor_variables[at(a)]);
    for (auto t = maps.term_start[here.row]; t < maps.term_start[here.row + 1]; ++t)
      f(maps.term_variable[at(t)]);
  }

  bool is_pose(int variable) const { return all_.column_of(variable) == pose_column_; }

  void collect_variables() {
    std::vector<int> variables;
    for (const std::int64_t o : observations_) {
      for_variables(locate(o), [&](int v) {
        if (places_[v] >= 0) return;
        places_.set(v, 0);
        variables.push_back(v);
      });
    }
    std::sort(variables.begin(), variables.end());
    scratch_ = make_piece(all_, std::move(variables));
    places_.mark(scratch_.variables);
    stamp_.assign(scratch_.variables.size(), -1);
    used_.assign(observations_.size(), false);
  }

  /// Observations of each pose: CSR over the leaf's variables.
  void collect_incidence() {
    incidence_start_.assign(scratch_.variables.size() + 1, 0);
    const auto visit = [&](auto&& f) {
      for (std::size_t o = 0; o < observations_.size(); ++o) {
        const Located here = locate(observations_[o]);
        if (here.column == nullptr && graph_.submaps.anchors[here.row]->tag != Tag("pose"))
          continue;
        for_variables(here, [&](int v) {
          if (is_pose(v)) f(at(places_[v]), static_cast<int>(o));
        });
      }
    };
    visit([&](std::size_t k, int) { ++incidence_start_[k + 1]; });
    for (std::size_t k = 0; k < scratch_.variables.size(); ++k)
      incidence_start_[k + 1] += incidence_start_[k];
    incidence_.resize(at(incidence_start_.back()));
    std::vector<int> fill(incidence_start_.begin(), incidence_start_.end() - 1);
    visit([&](std::size_t k, int o) { incidence_[at(fill[k]++)] = o; });
  }

  double* value(int k) { return value_of(all_, scratch_, k); }
  Rigid<D>& pose(int k) { return *reinterpret_cast<Rigid<D>*>(value(k)); }

  /// Sets variable k from its value z in the frame of T, unless the growing piece has it. A pose of
  /// an earlier piece grows there, and is only in this one when that stands `alone`.
  void put(int k, const Rigid<D>& T, const double* z, int stamp, bool alone = false) {
    if (stamp_[at(k)] == stamp) return;
    const int c = all_.column_of(scratch_.variables[at(k)]);
    if (c == pose_column_ && stamp_[at(k)] >= 0 && !alone) return;
    const VariableKind<D>& kind = *all_.column(c).kind;
    double* const x = value(k);
    std::memcpy(x, z, static_cast<std::size_t>(kind.value_size) * sizeof(double));
    kind.transform(T, x, 1);
    stamp_[at(k)] = stamp;
    members_.push_back(k);
    if (c == pose_column_) queue_.push_back(k);
  }

  void spread(int o, int from, int stamp) {
    used_[at(o)] = true;
    const Located here = locate(observations_[at(o)]);
    const Rigid<D> identity;
    if (here.column != nullptr) {
      const int a = places_[here.column->from[here.row]];
      const int b = places_[here.column->to[here.row]];
      const double* z = here.column->z.data() +
                        here.row * static_cast<std::size_t>(here.column->kind->value_size);
      if (a == from) {
        put(b, pose(a), z, stamp);
      } else {
        const Rigid<D> T = pose(b) * reinterpret_cast<const Rigid<D>*>(z)->inverse();
        put(a, T, reinterpret_cast<const double*>(&identity), stamp);
      }
      return;
    }
    const auto& maps = graph_.submaps;
    const int a = places_[maps.anchor_variables[at(maps.anchor_start[here.row])]];
    Rigid<D> T = pose(a);
    if (a != from) {
      for (auto t = maps.term_start[here.row]; t < maps.term_start[here.row + 1]; ++t) {
        if (places_[maps.term_variable[at(t)]] != from) continue;
        const double* z = maps.values.data() + maps.term_value[at(t)];
        T = pose(from) * reinterpret_cast<const Rigid<D>*>(z)->inverse();
        break;
      }
      put(a, T, reinterpret_cast<const double*>(&identity), stamp);
      T = pose(a);
    }
    for (auto t = maps.term_start[here.row]; t < maps.term_start[here.row + 1]; ++t) {
      put(places_[maps.term_variable[at(t)]], T, maps.values.data() + maps.term_value[at(t)],
          stamp);
    }
  }

  Piece<D> grow_from(int seed, int stamp) {
    members_.clear();
    queue_.clear();
    std::vector<std::int64_t> taken;
    const Rigid<D> identity;
    put(seed, identity, reinterpret_cast<const double*>(&identity), stamp);
    for (std::size_t next = 0; next < queue_.size(); ++next) {
      const int k = queue_[next];
      for (int i = incidence_start_[at(k)]; i < incidence_start_[at(k) + 1]; ++i) {
        const int o = incidence_[at(i)];
        if (used_[at(o)]) continue;
        spread(o, k, stamp);
        taken.push_back(observations_[at(o)]);
      }
    }
    return extract(std::move(taken));
  }

  /// A submap whose anchor is no pose: its own values, in its own frame.
  Piece<D> alone(std::size_t o, int stamp) {
    members_.clear();
    queue_.clear();
    used_[o] = true;
    const Located here = locate(observations_[o]);
    const auto& maps = graph_.submaps;
    for (auto t = maps.term_start[here.row]; t < maps.term_start[here.row + 1]; ++t) {
      put(places_[maps.term_variable[at(t)]], Rigid<D>(),
          maps.values.data() + maps.term_value[at(t)], stamp, true);
    }
    std::vector<double*> anchor;
    for (auto a = maps.anchor_start[here.row]; a < maps.anchor_start[here.row + 1]; ++a) {
      const int k = places_[maps.anchor_variables[at(a)]];
      if (stamp_[at(k)] != stamp) {  // no term: pinned whole, so the frame knows it
        std::fill_n(value(k), all_.kind(scratch_.variables[at(k)]).value_size, 0.0);
        stamp_[at(k)] = stamp;
        members_.push_back(k);
      }
      anchor.push_back(value(k));
    }
    maps.anchors[here.row]->pin(anchor.data());
    return extract({observations_[o]});
  }

  Piece<D> extract(std::vector<std::int64_t> observations) {
    std::sort(members_.begin(), members_.end());
    std::vector<int> variables;
    variables.reserve(members_.size());
    for (const int k : members_) variables.push_back(scratch_.variables[at(k)]);
    Piece<D> out = make_piece(all_, std::move(variables));
    std::size_t c = 0;
    for (int k = 0; k < out.size(); ++k) {
      while (k >= out.column_start[c + 1]) ++c;
      const auto size = static_cast<std::size_t>(all_.column(static_cast<int>(c)).kind->value_size);
      std::memcpy(out.data[c].data() + static_cast<std::size_t>(k - out.column_start[c]) * size,
                  value(members_[at(k)]), size * sizeof(double));
    }
    out.observations = std::move(observations);
    return out;
  }

  const MeasurementGraph<D>& graph_;
  const VariableSet<D>& all_;
  std::span<const std::int64_t> observations_;
  Places& places_;
  int pose_column_ = -1;
  Piece<D> scratch_;
  std::vector<int> stamp_;  // per variable of the leaf: the last piece that holds it
  std::vector<bool> used_;  // per observation of the leaf
  std::vector<int> incidence_start_, incidence_;
  std::vector<int> members_, queue_;
};

}  // namespace

template <int D>
std::vector<Piece<D>> leaf_pieces(const MeasurementGraph<D>& graph,
                                  std::span<const std::int64_t> observations, Places& places) {
  return LeafGrower<D>(graph, observations, places).grow();
}

#define MAPJOIN_INSTANTIATE(D)                                              \
  template std::vector<Piece<D>> leaf_pieces<D>(const MeasurementGraph<D>&, \
                                                std::span<const std::int64_t>, Places&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
