#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/graph/anchor.h"
#include "mapjoin/graph/block_matrix.h"
#include "mapjoin/graph/variables.h"

namespace mapjoin {

template <int D>
struct LocalMap;

/// Measurements of variables of one type, each taken from a pose and written in its frame.
/// z and info hold value_size and dim x dim doubles a measurement.
template <int D>
struct RelativeMeasurements {
  const VariableKind<D>* kind = nullptr;
  std::vector<std::int32_t> from;  ///< number of the pose
  std::vector<std::int32_t> to;    ///< number of the observed variable
  std::vector<double> z;
  std::vector<double> info;

  std::size_t size() const { return from.size(); }
};

/// Local maps as integrated observations: several variables seen from one anchor, with a joint
/// information.
///
/// Observation k has anchor kind anchors[k] with keys numbered anchor_variables[k]; terms
/// term_start[k] .. term_start[k+1]-1, sorted by variable; and blocks block_start[k] ..
/// block_start[k+1]-1 of its information.
template <int D>
struct SubmapObservations {
  std::vector<const AnchorKind<D>*> anchors;
  std::vector<std::int64_t> anchor_start{0};
  std::vector<std::int32_t> anchor_variables;
  std::vector<std::int64_t> term_start{0};
  std::vector<std::int32_t> term_variable;
  std::vector<std::int64_t> term_value;  ///< first double in values
  std::vector<double> values;
  std::vector<std::int64_t> block_start{0};
  std::vector<std::int32_t> block_row;  ///< term within the observation
  std::vector<std::int32_t> block_column;
  std::vector<std::int64_t>
      block_value;  ///< first double in information, dim(row) x dim(column), row >= column
  std::vector<double> information;

  std::size_t size() const { return anchors.size(); }
};

/// A graph of relative information: everything that is known, and nothing about where anything is.
///
/// Observations are numbered: first the relative measurements, type by type, then the submaps.
template <int D>
struct MeasurementGraph {
  VariableSet<D> variables;
  std::vector<RelativeMeasurements<D>> relative;
  SubmapObservations<D> submaps;

  /// Number of observations.
  std::size_t size() const;
  /// Number of scalar residuals. Less the number of unknowns it is what chi2 should be about.
  std::size_t residuals() const;
};

/// CSR list of the variables each observation touches, anchor first.
struct CliqueList {
  std::vector<std::int64_t> start{0};
  std::vector<std::int32_t> variables;
  std::size_t size() const { return start.size() - 1; }
};
template <int D>
CliqueList cliques(const MeasurementGraph<D>& graph);

/// Collects measurements in any order, from memory or from a reader.
///
///     MeasurementGraphBuilder<2> builder;
///     builder.add<Pose2>(pose_key(0), pose_key(1), rigid2(1, 0, 0.1), information);
///     builder.add<Point2>(pose_key(0), point_key(7), {2.0, 1.0}, information);
///     const MeasurementGraph<2> graph = std::move(builder).build();
template <int D>
class MeasurementGraphBuilder {
 public:
  MeasurementGraphBuilder() = default;

  /// A measurement z of `to` in the frame of pose `from`; `information` is dim x dim in the tangent
  /// at z. \throws InputError for a self-loop and for values that are not finite.
  template <VariableType T>
  void add(const Key& from, const Key& to, const ValueOf<T>& z,
           const Mat<T::dim, T::dim>& information) {
    add(kind_of<T>(), from, to, reinterpret_cast<const double*>(&z), information.data());
  }
  void add(const VariableKind<D>& kind, const Key& from, const Key& to, const double* z,
           const double* information);

  /// A local map. Terms whose information is independent of all others become relative measurements
  /// when the anchor is a pose: the same information, in its cheapest form. In the frame of other
  /// anchors all terms stay together.
  void add(const LocalMap<D>& local_map);

  /// All observations of another graph.
  void add(const MeasurementGraph<D>& graph);

  void reserve(const VariableKind<D>& kind, std::size_t measurements);

  /// O(n log n) in the number of variables, O(n) in measurements.
  MeasurementGraph<D> build() &&;

 private:
  struct Relative {
    const VariableKind<D>* kind;
    std::vector<Key> from, to;
    std::vector<double> z, info;
  };
  struct SubmapKeys {
    std::vector<Key> anchor, terms;
    std::vector<const VariableKind<D>*> kinds;
  };

  Relative& column(const VariableKind<D>& kind);
  void add_submap(const LocalMap<D>& local_map, std::span<const int> terms);

  std::vector<Relative> relative_;
  SubmapObservations<D> submaps_;  // variable numbers are filled in by build()
  SubmapKeys submap_keys_;
};

/// Splits a graph into parts that share no variable. In order of their lowest key.
template <int D>
std::vector<MeasurementGraph<D>> connected_components(const MeasurementGraph<D>& graph);

/// The part of a graph that consists of the given observations (ascending numbers), over their
/// variables only.
template <int D>
MeasurementGraph<D> subgraph(const MeasurementGraph<D>& graph,
                             std::span<const std::int64_t> observations);

extern template struct MeasurementGraph<2>;
extern template struct MeasurementGraph<3>;
extern template class MeasurementGraphBuilder<2>;
extern template class MeasurementGraphBuilder<3>;

}  // namespace mapjoin
