#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "mapjoin/building/model_kind.h"
#include "mapjoin/graph/measurement_graph.h"

namespace mapjoin {

/// Measurements of one model, each of a variable from a pose.
template <int D>
struct RawMeasurements {
  const ModelKind<D>* model = nullptr;
  std::vector<std::int32_t> from;  ///< number of the pose
  std::vector<std::int32_t> to;    ///< number of the target
  std::vector<double> z;           ///< model->measured doubles each
  std::vector<double> info;        ///< model->dim squared each, of the residual

  std::size_t size() const { return from.size(); }
};

/// A recording: what the sensors of one or several robots said, before any map is made of it.
///
/// Measurements are numbered column by column. Order in time is the order of the poses' keys.
template <int D>
struct RawLog {
  VariableSet<D> variables;
  std::vector<RawMeasurements<D>> columns;

  std::size_t size() const;
  /// Column and row of measurement m.
  std::pair<std::size_t, std::size_t> find(std::int64_t m) const;
};

/// Collects measurements in any order.
///
///     RawLogBuilder<2> builder;
///     builder.add<VelocityTurnRate>(pose_key(0), pose_key(1), {1.2, 0.05, 0.3}, information);
///     builder.add<RangeBearing>(pose_key(1), point_key(7), {4.1, 0.8}, information);
///     const RawLog<2> log = std::move(builder).build();
template <int D>
class RawLogBuilder {
 public:
  /// A measurement z of `to` from pose `from`, with the information of its residual. \throws
  /// InputError that names the variables when `from` is no pose or the world, when both are the
  /// same, for values that are not finite, and for information that is not symmetric and positive
  /// definite.
  template <MeasurementModel M>
  void add(const Key& from, const Key& to, const typename M::Measurement& z,
           const Mat<M::dim, M::dim>& information) {
    add(model_of<M>(), from, to, reinterpret_cast<const double*>(&z), information.data());
  }
  void add(const ModelKind<D>& model, const Key& from, const Key& to, const double* z,
           const double* information);

  /// O(n log n) in the number of variables. \throws InputError when there is no measurement.
  RawLog<D> build() &&;

 private:
  struct Column {
    const ModelKind<D>* model;
    std::vector<Key> from, to;
    std::vector<double> z, info;
  };
  std::vector<Column> columns_;
};

/// The relative measurements of a graph as a recording, in the same order. \throws InputError when
/// the graph holds local maps or measurements from the world, which no local map is built from.
template <int D>
RawLog<D> raw_log(const MeasurementGraph<D>& graph);

/// The recording as a measurement graph: when all its measurements are relative poses and points
/// (and what else is a `RelativeModel`), which are integrated observations themselves. \returns
/// whether they are; else `graph` is left as it was.
template <int D>
bool as_graph(const RawLog<D>& log, MeasurementGraph<D>& graph);

extern template struct RawLog<2>;
extern template struct RawLog<3>;
extern template class RawLogBuilder<2>;
extern template class RawLogBuilder<3>;

}  // namespace mapjoin
