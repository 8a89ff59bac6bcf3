#include <fmt/format.h>

#include <memory>

#include "mapjoin/cli/commands.h"
#include "mapjoin/cli/run.h"
#include "mapjoin/frames/change_frame.h"
#include "mapjoin/io/native_map.h"
#include "mapjoin/solvers/expect_determined.h"

namespace mapjoin::cli {

namespace {

constexpr const char* kReframeExamples = R"(Example:
  mapjoin reframe city.map --anchor pose:4711 --output city_4711.map
      The same map seen from another pose, in closed form: the estimate and its information, exact
      and without a solve. The frame of a map is a free choice.
  mapjoin reframe park.map --anchor points:84,85 --output park_84.map
      Seen from two of its features: 84 at the origin, 85 on the positive x axis. A map of features
      alone has no other frame. In space it takes three, as in points:84,85,86.
)";

struct ReframeCommand {
  std::string map;
  std::string anchor;
  std::string output;
};

void reframe(const ReframeCommand& a) {
  output_format(a.output);
  OutputFiles::expect(a.output);
  std::visit(
      [&]<int D>(Map<D>&& map) {
        const Anchor<D> anchor =
            chosen_anchor<D>(a.anchor, session_of(map.variables()), map.variables());
        const std::string before = to_string(map.anchor);
        expect_determined(map, anchor);
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

void add_reframe(Command& app) {
  auto arguments = std::make_shared<ReframeCommand>();
  Command command =
      app.add_command("reframe", "Write a map in the frame of another pose, or of features");
  command.add_option("map", arguments->map, "A native map").type_name("MAP").required();
  command
      .add_option("--anchor", arguments->anchor, std::string("The frame to write in: ") + kAnchors)
      .type_name("ANCHOR")
      .required();
  command
      .add_option("-o,--output", arguments->output, "OUT.map, or OUT.g2o, OUT.tum for the values")
      .type_name("FILE")
      .required();
  command.examples(kReframeExamples);
  command.run([arguments] { reframe(*arguments); });
}

}  // namespace mapjoin::cli
