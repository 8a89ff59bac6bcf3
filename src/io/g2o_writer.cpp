#include <fmt/format.h>

#include <Eigen/Geometry>
#include <iterator>
#include <string>
#include <vector>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/world.h"
#include "mapjoin/io/atomic_file.h"
#include "mapjoin/io/g2o.h"
#include "mapjoin/io/plain_ids.h"
#include "mapjoin/io/pose_text.h"

namespace mapjoin {

namespace {

template <int D>
class GraphWriter {
 public:
  GraphWriter(const Values<D>* values, const MeasurementGraph<D>* graph,
              const G2oWriteOptions& options)
      : values_(values),
        graph_(graph),
        options_(options),
        ids_(sets(), options.feature_offset, "g2o") {}

  std::string text() && {
    write_comments();
    if (D == 3 && graph_ != nullptr &&
        (graph_->variables.find_column(Tag("point")) >= 0 || graph_->variables.find(world_key()))) {
      out_ += "PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n";
    }
    if (values_ != nullptr) write_vertices();
    if (options_.fixed && *options_.fixed != world_key())
      out_ += fmt::format("FIX {}\n", ids_(*options_.fixed));
    if (graph_ != nullptr) write_edges();
    return std::move(out_);
  }

 private:
  std::vector<const VariableSet<D>*> sets() const {
    std::vector<const VariableSet<D>*> out;
    if (values_ != nullptr) out.push_back(&values_->variables());
    if (graph_ != nullptr) out.push_back(&graph_->variables);
    if (!options_.fixed) return out;
    for (const VariableSet<D>* set : out) {
      if (set->find(*options_.fixed)) return out;
    }
    throw InputError(fmt::format("FIX {}: there is no such variable in what is written",
                                 to_string(*options_.fixed)));
  }

  void write_comments() {
    for (std::size_t at = 0; at < options_.comment.size();) {
      const std::size_t end = std::min(options_.comment.find('\n', at), options_.comment.size());
      out_ += "# " + options_.comment.substr(at, end - at) + "\n";
      at = end + 1;
    }
    for (const std::string& note : ids_.notes()) out_ += "# " + note + "\n";
    if (values_ == nullptr || !values_->contains(world_key())) return;
    out_ += "# the world is at";
    detail::append_pose<D>(out_, values_->pose(world_key()));
    out_ += '\n';
  }

  void write_vertices() {
    for (const Tag type : {Tag("pose"), Tag("point")}) {
      const int column = values_->variables().find_column(type);
      if (column < 0) continue;
      const auto& c = values_->variables().column(column);
      for (int k = 0; k < c.size(); ++k) {
        if (c.keys[static_cast<std::size_t>(k)] == world_key()) continue;
        append("{} {}", tag(type == Tag("pose"), true), ids_(c.keys[static_cast<std::size_t>(k)]));
        append_value(type == Tag("pose"), values_->value(c.first + k));
        out_ += '\n';
      }
    }
  }

  void write_edges() {
    if (graph_->submaps.size() > 0) {
      throw InputError(
          fmt::format("g2o has no word for the joint information of several variables, and this "
                      "graph holds {} such local "
                      "maps; write a native map instead",
                      graph_->submaps.size()));
    }
    for (const Tag type : {Tag("pose"), Tag("point")}) {
      for (const RelativeMeasurements<D>& edges : graph_->relative) {
        if (edges.kind->tag == type) write_edges(type == Tag("pose"), edges);
      }
    }
  }

  void write_edges(bool poses, const RelativeMeasurements<D>& edges) {
    const int dim = edges.kind->dim;
    for (std::size_t k = 0; k < edges.size(); ++k) {
      if (poses && is_world(edges.from[k])) {
        write_prior(edges, k);
        continue;
      }
      ((out_ += tag(poses, false)) += ' ') += id(edges.from[k]);
      (out_ += ' ') += id(edges.to[k]);
      if (D == 3 && !poses) out_ += " 0";
      append_value(poses, edges.z.data() + k * static_cast<std::size_t>(edges.kind->value_size));
      append_information(poses, dim, edges.info.data() + k * static_cast<std::size_t>(dim * dim));
      out_ += '\n';
    }
  }

  /// A measurement of a pose from the world: of all of it, or of its position.
  void write_prior(const RelativeMeasurements<D>& edges, std::size_t k) {
    constexpr int G = kGauge<D>;
    const auto& z = reinterpret_cast<const Rigid<D>*>(edges.z.data())[k];
    const double* const information = edges.info.data() + k * G * G;
    const Eigen::Map<const Mat<G, G>> info(information);
    const bool position = (info.template rightCols<kRotation<D>>().array() == 0.0).all();
    if (position) {
      append("{} {}", D == 2 ? "EDGE_PRIOR_SE2_XY" : "EDGE_SE3_PRIORXYZ", id(edges.to[k]));
      append_value(false, z.t.data());
      const Mat<D, D> in_world = z.R * info.template topLeftCorner<D, D>() * z.R.transpose();
      append_information(false, D, in_world.data());
    } else {
      append("{} {}", D == 2 ? "EDGE_PRIOR_SE2" : "EDGE_SE3_PRIOR", id(edges.to[k]));
      if (D == 3) out_ += " 0";
      append_value(true, reinterpret_cast<const double*>(&z));
      append_information(true, G, information);
    }
    out_ += '\n';
  }

  static const char* tag(bool pose, bool vertex) {
    if (D == 2)
      return vertex ? (pose ? "VERTEX_SE2" : "VERTEX_XY") : (pose ? "EDGE_SE2" : "EDGE_SE2_XY");
    return vertex ? (pose ? "VERTEX_SE3:QUAT" : "VERTEX_TRACKXYZ")
                  : (pose ? "EDGE_SE3:QUAT" : "EDGE_SE3_TRACKXYZ");
  }
  bool is_world(std::int32_t variable) const {
    return graph_->variables.key(variable) == world_key();
  }
  std::string id(std::int32_t variable) const {
    return is_world(variable) ? std::string(kWorldName)
                              : std::to_string(ids_(graph_->variables.key(variable)));
  }

  void append_value(bool pose, const double* x) {
    if (pose) {
      detail::append_pose<D>(out_, *reinterpret_cast<const Rigid<D>*>(x));
    } else {
      for (int k = 0; k < D; ++k) detail::append_number(out_, x[k]);
    }
  }

  void append_information(bool pose, int dim, const double* information) {
    for (int i = 0; i < dim; ++i) {
      for (int j = i; j < dim; ++j) {
        double factor = 1.0;
        if (D == 3 && pose && options_.quaternion_information)
          factor = (i < 3 ? 1.0 : 2.0) * (j < 3 ? 1.0 : 2.0);
        detail::append_number(out_, factor * information[i + j * dim]);
      }
    }
  }

  template <class... Args>
  void append(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(out_), format, std::forward<Args>(args)...);
  }

  const Values<D>* values_;
  const MeasurementGraph<D>* graph_;
  const G2oWriteOptions& options_;
  PlainIds<D> ids_;
  std::string out_;
};

}  // namespace

template <int D>
void write_g2o(const std::filesystem::path& file, const Values<D>& values,
               const G2oWriteOptions& options) {
  write_atomically(file, GraphWriter<D>(&values, nullptr, options).text());
}

template <int D>
void write_g2o(const std::filesystem::path& file, const MeasurementGraph<D>& graph,
               const std::type_identity_t<Values<D>>* values, const G2oWriteOptions& options) {
  write_atomically(file, GraphWriter<D>(values, &graph, options).text());
}

#define MAPJOIN_INSTANTIATE(D)                                                         \
  template void write_g2o<D>(const std::filesystem::path&, const Values<D>&,           \
                             const G2oWriteOptions&);                                  \
  template void write_g2o<D>(const std::filesystem::path&, const MeasurementGraph<D>&, \
                             const Values<D>*, const G2oWriteOptions&);
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
