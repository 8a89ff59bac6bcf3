#include "mapjoin/building/raw_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mapjoin/graph/check_local_map.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/graph/key_numbering.h"
#include "mapjoin/graph/symmetric.h"
#include "mapjoin/graph/world.h"

namespace mapjoin {

namespace {

void check_numbers(const Key& from, const Key& to, const double* z, int measured,
                   const double* information, int dim) {
  const auto finite = [](double v) { return std::isfinite(v); };
  if (!std::all_of(z, z + measured, finite) ||
      !std::all_of(information, information + dim * dim, finite)) {
    throw InputError(fmt::format("the measurement {} -> {} holds a number that is not finite",
                                 to_string(from), to_string(to)));
  }
  const Eigen::Map<const Eigen::MatrixXd> info(information, dim, dim);
  const double size = info.cwiseAbs().maxCoeff();
  if (!(info - info.transpose()).isZero(1e-9 * size) || eigenvalues(info).minCoeff() <= 0.0) {
    throw InputError(fmt::format(
        "the information of {} -> {} is not symmetric and positive definite: local maps are built "
        "from measurements that say something of each of their numbers",
        to_string(from), to_string(to)));
  }
}

template <int D>
void check_ends(const Key& from, const Key& to) {
  if (from.type != Tag("pose"))
    throw InputError(fmt::format("the measurement {} -> {} is not taken from a pose",
                                 to_string(from), to_string(to)));
  if (from == to)
    throw InputError(
        fmt::format("a measurement of {} from itself says nothing: remove it", to_string(from)));
  if (from == world_key() || to == world_key()) {
    throw InputError(fmt::format(
        "{} -> {} is a measurement from the world, which is no robot that could build a local map: "
        "leave such measurements to the join (mapjoin join MAPS --links)",
        to_string(from), to_string(to)));
  }
}

}  // namespace

template <int D>
std::size_t RawLog<D>::size() const {
  std::size_t n = 0;
  for (const auto& column : columns) n += column.size();
  return n;
}

template <int D>
std::pair<std::size_t, std::size_t> RawLog<D>::find(std::int64_t m) const {
  std::size_t c = 0;
  auto row = static_cast<std::size_t>(m);
  while (row >= columns[c].size()) row -= columns[c++].size();
  return {c, row};
}

template <int D>
void RawLogBuilder<D>::add(const ModelKind<D>& model, const Key& from, const Key& to,
                           const double* z, const double* information) {
  check_ends<D>(from, to);
  check_type(*model.target, to);
  check_numbers(from, to, z, model.measured, information, model.dim);
  auto column = std::find_if(columns_.begin(), columns_.end(), [&](const Column& c) {
    return c.model->residual == model.residual;  // names may be taken twice, functions not
  });
  if (column == columns_.end()) {
    columns_.push_back({&model, {}, {}, {}, {}});
    column = columns_.end() - 1;
  }
  column->from.push_back(from);
  column->to.push_back(to);
  column->z.insert(column->z.end(), z, z + model.measured);
  column->info.insert(column->info.end(), information, information + model.dim * model.dim);
}

template <int D>
RawLog<D> RawLogBuilder<D>::build() && {
  if (columns_.empty()) throw InputError("there are no measurements: nothing to build from");
  KeyNumbering<D> numbering;
  for (const Column& c : columns_) {
    numbering.add(kind_of<PoseType<D>>(), c.from);
    numbering.add(*c.model->target, c.to);
  }
  RawLog<D> log;
  log.variables = numbering.number();
  for (Column& c : columns_) {
    log.columns.push_back({c.model, numbering.numbers(c.from), numbering.numbers(c.to),
                           std::move(c.z), std::move(c.info)});
  }
  return log;
}

template <int D>
RawLog<D> raw_log(const MeasurementGraph<D>& graph) {
  if (graph.submaps.size() > 0)
    throw InputError("the graph holds local maps: join them, there is nothing to build");
  RawLog<D> log;
  log.variables = graph.variables;
  for (const auto& column : graph.relative) {
    const ModelKind<D>* model = nullptr;
    if (column.kind->tag == Tag("pose")) model = &model_of<RelativeModel<PoseType<D>>>();
    if (column.kind->tag == Tag("point")) model = &model_of<RelativeModel<PointType<D>>>();
    if (model == nullptr) {
      throw InputError(fmt::format(
          "measurements of type {}: which model they follow only their maker knows; use "
          "RawLogBuilder",
          column.kind->tag.text()));
    }
    const auto dim = static_cast<std::size_t>(model->dim);
    for (std::size_t k = 0; k < column.size(); ++k) {
      const Key& from = graph.variables.key(column.from[k]);
      const Key& to = graph.variables.key(column.to[k]);
      check_ends<D>(from, to);
      check_numbers(from, to, &column.z[k * static_cast<std::size_t>(model->measured)],
                    model->measured, &column.info[k * dim * dim], model->dim);
    }
    log.columns.push_back({model, column.from, column.to, column.z, column.info});
  }
  if (log.size() == 0) throw InputError("there are no measurements: nothing to build from");
  return log;
}

template <int D>
bool as_graph(const RawLog<D>& log, MeasurementGraph<D>& graph) {
  const auto is_relative = [](const RawMeasurements<D>& c) { return c.model->relative; };
  if (!std::all_of(log.columns.begin(), log.columns.end(), is_relative)) return false;
  graph = {};
  graph.variables = log.variables;
  for (const auto& c : log.columns)
    graph.relative.push_back({c.model->target, c.from, c.to, c.z, c.info});
  return true;
}

#define MAPJOIN_INSTANTIATE(D)                                     \
  template struct RawLog<D>;                                       \
  template class RawLogBuilder<D>;                                 \
  template RawLog<D> raw_log<D>(const MeasurementGraph<D>& graph); \
  template bool as_graph<D>(const RawLog<D>&, MeasurementGraph<D>&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
