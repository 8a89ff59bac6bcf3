#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "mapjoin/cli/arguments.h"
#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/input.h"
#include "mapjoin/cli/terminal.h"
#include "mapjoin/frames/anchors.h"
#include "mapjoin/io/local_maps.h"
#include "mapjoin/io/native_map.h"
#include "mapjoin/io/read_file.h"

namespace mapjoin::cli {

namespace {

constexpr const char* kInfoExamples = R"(Examples:
  mapjoin info graph.g2o
  mapjoin info city.map
  mapjoin info victoria_park_200
)";

void line(const std::string& head, const std::string& body) {
  const std::string padded = fmt::format("{:<14}", head);
  fmt::print("{}{}\n", bold(padded), body);
}

/// "3500 pose (pose:0 ... pose:3499), 12 point (...)".
template <int D>
std::string describe(const VariableSet<D>& variables) {
  std::string out;
  for (const auto& c : variables.columns()) {
    out += fmt::format("{}{} {} ({} ... {})", out.empty() ? "" : ", ", c.size(), c.kind->tag.text(),
                       to_string(c.keys.front()), to_string(c.keys.back()));
  }
  return out.empty() ? "none" : out;
}

template <int D>
void show_graph(const MeasurementGraph<D>& graph) {
  line("variables", describe(graph.variables));
  std::vector<int> degree(static_cast<std::size_t>(graph.variables.size()), 0);
  const CliqueList all = cliques(graph);
  for (const std::int32_t v : all.variables) ++degree[static_cast<std::size_t>(v)];
  const auto most = std::max_element(degree.begin(), degree.end());
  if (most != degree.end()) {
    line("degree",
         fmt::format("{:.2f} measurements a variable, most at {}: {}",
                     static_cast<double>(all.variables.size()) / static_cast<double>(degree.size()),
                     to_string(graph.variables.key(static_cast<int>(most - degree.begin()))),
                     *most));
  }
  const auto pieces = connected_components(graph);
  std::string sizes;
  for (std::size_t k = 0; k < pieces.size() && k < 5; ++k) {
    sizes += fmt::format("{}{}", k == 0 ? "" : ", ", pieces[k].variables.size());
  }
  if (pieces.size() > 5) sizes += ", ...";
  line("components",
       pieces.size() == 1 ? "1" : fmt::format("{} (variables: {})", pieces.size(), sizes));
}

bool is_solution(const std::string& g2o) {
  return g2o.find("EDGE") == std::string::npos && g2o.find("VERTEX") != std::string::npos;
}

void show_g2o(const std::string& path) {
  G2oOptions options;
  options.skip_unknown = true;
  if (is_solution(read_file(path))) {
    std::visit(
        [&]<int D>(const Values<D>& values) {
          line("file", fmt::format("{}: {}D solution in g2o, no measurements", path, D));
          line("variables", describe(values.variables()));
        },
        read_g2o_values(path, options));
    return;
  }
  options.indefinite = InformationPolicy::kIsotropic;  // to count, not to repair
  const G2oGraph file = read_g2o(path, options);
  line("file", fmt::format("{}: {}D measurement graph in g2o", path, file.dimension));
  line("measurements", list_of(file.counts.edges));
  std::visit([](const auto& graph) { show_graph(graph); }, file.graph);
  line("fixed", file.fixed ? to_string(*file.fixed) : "nothing");
  if (!file.counts.skipped.empty()) {
    line("unknown", list_of(file.counts.skipped) + "; solve needs --skip-unknown");
  }
  if (file.counts.isolated_vertices > 0) {
    line("isolated",
         fmt::format("{} vertices without measurements", file.counts.isolated_vertices));
  }
  if (file.counts.repaired > 0) {
    line("indefinite", fmt::format("{} information matrices; solve needs --indefinite clamp or "
                                   "isotropic",
                                   file.counts.repaired));
  }
}

void show_map(const std::string& path) {
  std::visit(
      [&]<int D>(const Map<D>& map) {
        line("file", fmt::format("{}: {}D native map", path, D));
        line("variables", describe(map.variables()));
        line("frame", to_string(map.anchor));
        line("solved in", to_string(map.solved_in));
        line("information", fmt::format("{} blocks, {} scalars", map.information.blocks(),
                                        map.information.scalars()));
        if (!map.observations) {
          line("observations", "none: the map is a summary");
          return;
        }
        line("observations",
             fmt::format("{} measurements, {} of them local maps", map.observations->size(),
                         map.observations->submaps.size()));
      },
      read_any_map(path));
}

void show_local_maps(const std::string& path) {
  LocalMapOptions options;
  options.indefinite = InformationPolicy::kIsotropic;
  std::visit(
      [&]<int D>(const LocalMapSet<D>& set) {
        std::size_t terms = 0;
        std::size_t largest = 0;
        MeasurementGraphBuilder<D> builder;
        for (const LocalMap<D>& map : set.maps) {
          terms += map.keys.size();
          largest = std::max(largest, map.keys.size());
          builder.add(map);
        }
        line("file", fmt::format("{}: {}D set of {} local maps, {}", path, D, set.maps.size(),
                                 set.pose_feature ? "poses and features" : "poses only"));
        line("map size",
             fmt::format("{:.1f} variables on average, {} at most",
                         static_cast<double>(terms) /
                             static_cast<double>(std::max<std::size_t>(1, set.maps.size())),
                         largest));
        show_graph(std::move(builder).build());
        if (set.repaired > 0) {
          line("indefinite",
               fmt::format("{} information matrices; join needs --indefinite clamp or "
                           "isotropic",
                           set.repaired));
        }
      },
      read_local_maps(path, options));
}

void info(const std::string& path) {
  switch (input_format(path)) {
    case InputFormat::kLocalMaps:
      return show_local_maps(path);
    case InputFormat::kNative:
      return show_map(path);
    case InputFormat::kG2o:
      return show_g2o(path);
  }
}

}  // namespace

void add_info(Command& app) {
  auto path = std::make_shared<std::string>();
  Command command = app.add_command("info", "Say what is in a file");
  command.add_option("file", *path, "g2o file, native map, or folder of local maps")
      .type_name("FILE")
      .required();
  command.examples(kInfoExamples);
  command.run([path] { info(*path); });
}

}  // namespace mapjoin::cli
