#include <fmt/format.h>

#include <memory>

#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/run.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/io/native_map.h"

namespace mapjoin::cli {

namespace {

constexpr const char* kExamples = R"(Example:
  mapjoin reframe city.map --anchor pose:4711 --output city_4711.map
      The same map seen from another pose, in closed form: the estimate and its information, exact
      and without a solve. The frame of a map is a free choice.
)";

struct Arguments {
  std::string map;
  std::string anchor;
  std::string output;
};

void reframe(const Arguments& a) {
  output_format(a.output);
  OutputFiles::expect(a.output);
  std::visit(
      [&]<int D>(Map<D>&& map) {
        const Anchor<D> anchor =
            parse_anchor<D>(a.anchor, session_of_poses(map.variables()), map.variables());
        const std::string before = to_string(map.anchor);
        map = change_frame(std::move(map), anchor);
        OutputFiles files;
        write_piece(files, a.output, map, false, false);
        files.commit();
        fmt::print("{}: {} variables, from the frame of {} to that of {}\n", a.output,
                   map.values.size(), before, to_string(map.anchor));
      },
      read_any_map(a.map));
}

}  // namespace

void add_reframe(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *app.add_subcommand("reframe", "Write a map in the frame of another pose");
  command.add_option("map", arguments->map, "A native map")->type_name("MAP")->required();
  command.add_option("--anchor", arguments->anchor, "The pose to be the origin, as in pose:12")
      ->type_name("KEY")
      ->required();
  command
      .add_option("-o,--output", arguments->output, "OUT.map, or OUT.g2o, OUT.tum for the values")
      ->type_name("FILE")
      ->required();
  add_examples(command, kExamples);
  command.callback([arguments] { reframe(*arguments); });
}

}  // namespace mapjoin::cli
