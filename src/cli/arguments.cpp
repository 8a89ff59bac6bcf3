#include "mapjoin/cli/arguments.h"

#include <fmt/format.h>

#include <algorithm>
#include <thread>

#include "mapjoin/frames/parse_anchor.h"

namespace mapjoin::cli {

const char* const kModes = R"(Modes:
  optimal   Every join keeps its measurements and linearises them anew; then linear solves over all
            of them until nothing moves: the nonlinear least squares optimum.
  observe   The same without the end: one linear solve a join and two at the last one.
  summary   A joined map is an estimate and its information and nothing else, as for maps that are
            shared, or kept for life. One linear solve a join.
  paper     Linear SLAM as published: pairs in order, one common pose. For comparison.
)";

const char* const kAnchors =
    "that of a pose, pose:12 or 1/pose:12 (session 1); world, where the data know of it; or of "
    "points, two in the plane "
    "(points:84,85: the first at the origin, the second on the positive x axis), three in space "
    "(points:84,85,86: the third in the x-y plane at positive y)";

void add_indefinite_argument(Command& command, std::string& indefinite) {
  command
      .add_option("--indefinite", indefinite,
                  "Information matrices with a negative eigenvalue: refuse the file; clamp them to "
                  "the nearest positive definite one; or replace them by isotropic ones")
      .one_of({"refuse", "clamp", "isotropic"})
      .show_default();
}

void add_join_arguments(Command& command, JoinArguments& a) {
  command
      .add_option("-o,--output", a.output,
                  "Where the result goes: OUT.g2o (poses and features as vertices), OUT.map (all "
                  "that a map is, to be joined again) or OUT.tum (trajectory). Further pieces of "
                  "data that are not connected go to OUT.2.g2o, OUT.3.g2o, ...")
      .type_name("FILE")
      .required();
  command.add_option("--mode", a.mode, "What a join carries on to the next; see below")
      .one_of({"optimal", "observe", "summary", "paper"})
      .show_default();
  command
      .add_option("--tree", a.tree,
                  "Which maps are joined with which: graph (neighbours in the graph) or order "
                  "(neighbours by number) [graph; in paper mode order]")
      .one_of({"graph", "order"});
  command
      .add_option("--strategy", a.strategy,
                  "dc (divide and conquer) or sequential (each map onto all before it)")
      .one_of({"dc", "sequential"})
      .show_default();
  command
      .add_option(
          "--threads", a.threads,
          "Threads to use, 0 for all there are; the result has the same bits for any number")
      .within(0, 1024)
      .show_default();
  command
      .add_option("--tolerance", a.tolerance,
                  "In optimal mode: refine until no more than this fraction of chi2 is left above "
                  "its minimum, by an estimate; at most 1e-3 [3e-7, which leaves less than 1e-6]")
      .type_name("FRACTION");
  command
      .add_option("--anchor", a.anchor,
                  std::string("The frame the result is written in: ") + kAnchors +
                      " [the pose that the file fixes, else the lowest one of each piece; points "
                      "that are far apart where there is no pose]")
      .type_name("ANCHOR");
  command
      .add_option("--session", a.session,
                  "Session of the ids that are read from text without one: recordings that both "
                  "count from 0 must have different ones")
      .type_name("N")
      .show_default();
  constexpr double kLeast = 1e6;  // bytes
  command
      .add_option("--memory-limit", a.memory_limit,
                  "Stay within this much memory, as in 600MB or 4GB: what does not fit is kept in "
                  "files; the result is the same, to the bit. 0: as much as it takes")
      .size_or_zero(kLeast)
      .type_name("SIZE");
  command
      .add_option("--scratch", a.scratch,
                  "Folder for those files, which vanish with the run [the temporary directory]")
      .type_name("DIR");
  command
      .add_option("--checkpoint", a.checkpoint,
                  "Keep finished subtrees in this folder: the same command takes up a run that was "
                  "killed. Emptied when the result is written")
      .type_name("DIR");
  add_indefinite_argument(command, a.indefinite);
  command.add_option("--json", a.json, "Write the report's figures to this file as well")
      .type_name("FILE");
  command.add_flag("--skip-unknown", a.skip_unknown,
                   "Count g2o records that are not understood instead of refusing the file");
  command.add_flag("--quaternion-information", a.quaternion_information,
                   "3D information in g2o files is of the quaternion's vector part, as g2o means "
                   "it, and not of the rotation vector");
}

InformationPolicy information_policy(const std::string& text) {
  if (text == "clamp") return InformationPolicy::kClamp;
  if (text == "isotropic") return InformationPolicy::kIsotropic;
  return InformationPolicy::kRefuse;
}

JoinOptions join_options(const JoinArguments& a) {
  JoinOptions options;
  if (a.mode == "paper") options.mode = Mode::kPaper;
  if (a.mode == "summary") options.mode = Mode::kSummary;
  if (a.mode == "observe") options.mode = Mode::kObserve;
  const bool in_order = a.tree == "order" || (a.tree.empty() && a.mode == "paper");
  options.tree = in_order ? TreeShape::kOrder : TreeShape::kGraph;
  if (a.strategy == "sequential") options.strategy = Strategy::kSequential;
  const unsigned all = std::max(1U, std::thread::hardware_concurrency());
  options.threads = a.threads == 0 ? static_cast<int>(all) : a.threads;
  if (a.tolerance) {
    if (options.mode != Mode::kOptimal) {
      throw InputError(fmt::format(
          "--tolerance is for optimal mode, which refines; leave it out with --mode {}", a.mode));
    }
    options.refine_tolerance = *a.tolerance;
  }
  options.memory_limit = static_cast<std::int64_t>(a.memory_limit);
  options.scratch = a.scratch;
  options.checkpoint = a.checkpoint;
  return options;
}

template <int D>
Anchor<D> chosen_anchor(const std::string& text, std::uint32_t session,
                        const VariableSet<D>& variables) {
  Anchor<D> anchor = parse_anchor<D>(text, session);
  for (const Key& key : anchor.keys) variables.require(key, "--anchor");
  return anchor;
}

template <int D>
std::uint32_t session_of(const VariableSet<D>& variables) {
  int c = variables.find_column(Tag("pose"));
  if (c < 0) c = variables.find_column(Tag("point"));
  if (c < 0) return 0;
  const auto& keys = variables.column(c).keys;
  return keys.front().session == keys.back().session ? keys.front().session : 0;
}

template <int D>
std::vector<Key> parse_keys(const std::vector<std::string>& texts,
                            const VariableSet<D>& variables) {
  std::vector<Key> out;
  for (const std::string& text : texts) {
    Key key = parse_key(text);
    const bool plain = text.find('/') == std::string::npos;
    if (plain && !variables.find(key)) key.session = session_of(variables);
    variables.require(key, "the command line");
    out.push_back(key);
  }
  return out;
}

template Anchor<2> chosen_anchor<2>(const std::string&, std::uint32_t, const VariableSet<2>&);
template Anchor<3> chosen_anchor<3>(const std::string&, std::uint32_t, const VariableSet<3>&);
template std::uint32_t session_of<2>(const VariableSet<2>&);
template std::uint32_t session_of<3>(const VariableSet<3>&);
template std::vector<Key> parse_keys<2>(const std::vector<std::string>&, const VariableSet<2>&);
template std::vector<Key> parse_keys<3>(const std::vector<std::string>&, const VariableSet<3>&);

}  // namespace mapjoin::cli
