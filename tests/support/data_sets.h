// The data sets of the Linear SLAM paper as problems to solve, with the figures to reach: what
// data/README.md beside them says.
#pragma once

#include <cstdlib>
#include <map>
#include <optional>
#include <ostream>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "mapjoin/io/g2o.h"
#include "mapjoin/io/local_maps.h"
#include "mapjoin/joining/join_all.h"
#include "tests/support/data.h"
#include "tests/support/program.h"

namespace mapjoin::test {

struct DataSet {
  std::string folder;  ///< pose_graphs, landmark_graphs or local_maps
  std::string name;
  double optimum = 0.0;  ///< chi2 of the nonlinear least squares optimum

  std::string label() const { return name + (folder == "local_maps" ? "_maps" : ""); }
  friend std::ostream& operator<<(std::ostream& out, const DataSet& set) {
    return out << set.label();
  }
};

/// A data set of one dimension, in memory.
template <int D>
struct Problem {
  MeasurementGraph<D> graph;            ///< all measurements
  std::vector<LocalMap<D>> local_maps;  ///< where it is a set of them
  std::optional<Values<D>> reference;   ///< the optimum, where there is one

  JoinResult<D> join(const JoinOptions& options) const {
    if (local_maps.empty()) return join_all(graph, options);
    return join_all(std::span<const LocalMap<D>>(local_maps), options);
  }
};

using AnyProblem = std::variant<Problem<2>, Problem<3>>;

/// A local-map set, unpacked for as long as the test program runs. Nothing where it is absent or
/// cannot be unpacked.
inline std::optional<std::filesystem::path> unpacked_local_maps(const std::string& name) {
  static const TemporaryDirectory scratch;
  static std::map<std::string, bool> unpacked;
  const auto archive = data_file("local_maps/" + name + ".tar.xz");
  if (!archive) return std::nullopt;
  const auto known = unpacked.find(name);
  bool ok = known != unpacked.end() && known->second;
  if (known == unpacked.end()) {
    const std::string command = "tar -xJf " + shell_quoted(archive->string()) + " -C " +
                                shell_quoted(scratch.path().string());
    ok = std::system(command.c_str()) == 0;
    unpacked[name] = ok;
  }
  if (!ok) return std::nullopt;
  return scratch.path() / name;
}

/// Reads a data set and its reference. Nothing where it is absent.
inline std::optional<AnyProblem> load(const DataSet& set) {
  const bool maps = set.folder == "local_maps";
  const auto file =
      maps ? unpacked_local_maps(set.name) : data_file(set.folder + "/" + set.name + ".g2o");
  if (!file) return std::nullopt;
  AnyProblem problem;
  if (maps) {
    std::visit(
        [&]<int D>(LocalMapSet<D>&& read) {
          Problem<D> p;
          MeasurementGraphBuilder<D> builder;
          for (const LocalMap<D>& map : read.maps) builder.add(map);
          p.graph = std::move(builder).build();
          p.local_maps = std::move(read.maps);
          problem = std::move(p);
        },
        read_local_maps(*file));
  } else {
    std::visit(
        [&]<int D>(MeasurementGraph<D>&& graph) {
          problem = Problem<D>{std::move(graph), {}, std::nullopt};
        },
        std::move(read_g2o(*file).graph));
  }
  const std::string like =
      set.folder == "landmark_graphs"
          ? (set.name == "dlr" ? "local_maps/dlr_3298" : "local_maps/victoria_park_6898")
          : set.folder + "/" + set.name;
  if (const auto reference = data_file("reference/" + like + ".g2o")) {
    G2oOptions options;
    if (maps) options.feature_offset = 100000;  // the maps' own numbers
    std::visit(
        [&]<int D>(Values<D>&& values) {
          std::get<Problem<D>>(problem).reference = std::move(values);
        },
        read_g2o_values(*reference, options));
  }
  return problem;
}

inline std::string missing(const DataSet& set) { return missing_data(set.folder + "/" + set.name); }

/// The measurements of a graph, one by one and in an order and under keys of the caller's choice.
template <int D>
class Edges {
 public:
  explicit Edges(const MeasurementGraph<D>& graph) : graph_(graph) {
    for (std::size_t c = 0; c < graph.relative.size(); ++c) {
      for (std::size_t k = 0; k < graph.relative[c].size(); ++k) edges_.emplace_back(c, k);
    }
  }

  std::size_t size() const { return edges_.size(); }
  const Key& from(std::size_t e) const { return key(column(e).from[edges_[e].second]); }
  const Key& to(std::size_t e) const { return key(column(e).to[edges_[e].second]); }

  /// Adds measurement e, as one between other keys.
  void add_to(MeasurementGraphBuilder<D>& builder, std::size_t e, const Key& from,
              const Key& to) const {
    const RelativeMeasurements<D>& c = column(e);
    const std::size_t k = edges_[e].second;
    const auto value = static_cast<std::size_t>(c.kind->value_size);
    const auto dim = static_cast<std::size_t>(c.kind->dim);
    builder.add(*c.kind, from, to, c.z.data() + k * value, c.info.data() + k * dim * dim);
  }

 private:
  const RelativeMeasurements<D>& column(std::size_t e) const {
    return graph_.relative[edges_[e].first];
  }
  const Key& key(std::int32_t variable) const { return graph_.variables.key(variable); }

  const MeasurementGraph<D>& graph_;
  std::vector<std::pair<std::size_t, std::size_t>> edges_;  ///< (column, row)
};

/// The same values under other keys.
template <int D, class Rename>
Values<D> renamed(const Values<D>& values, Rename&& rename) {
  ValuesBuilder<D> builder;
  for (int i = 0; i < values.size(); ++i) {
    builder.add(values.variables().kind(i), rename(values.variables().key(i)), values.value(i));
  }
  return std::move(builder).build();
}

}  // namespace mapjoin::test
