#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mapjoin/cli/command.h"
#include "mapjoin/graph/anchor.h"
#include "mapjoin/graph/variables.h"
#include "mapjoin/io/information_policy.h"
#include "mapjoin/joining/options.h"

namespace mapjoin::cli {

/// What `solve` and `join` have in common, as the user wrote it.
struct JoinArguments {
  std::string output;
  std::string json;
  std::string method = "linear";  ///< of `join`
  std::string mode = "optimal";
  std::string tree;
  std::string strategy = "dc";
  std::string anchor;
  std::string indefinite = "refuse";
  int threads = 1;
  std::optional<double> tolerance;  ///< of `refine`
  std::uint32_t session = 0;
  std::uint64_t memory_limit = 0;
  std::string scratch;
  std::string checkpoint;
  bool skip_unknown = false;
  bool quaternion_information = false;
};

void add_join_arguments(Command& command, JoinArguments& arguments);

JoinOptions join_options(const JoinArguments& arguments);
InformationPolicy information_policy(const std::string& text);
void add_indefinite_argument(Command& command, std::string& indefinite);

/// The anchor that --anchor names (see frames/parse_anchor.h); ids without a session are of
/// `session`. \throws InputError when it is none or when the variables have no such pose or point.
template <int D>
Anchor<D> chosen_anchor(const std::string& text, std::uint32_t session,
                        const VariableSet<D>& variables);

/// What --anchor takes, for the help of the commands that have it.
extern const char* const kAnchors;

/// The session that a plain id means: that of the map's poses (or points, where it has no
/// poses), if they have one.
template <int D>
std::uint32_t session_of(const VariableSet<D>& variables);

/// Keys from texts like "point:12" or "1/point:12"; a plain one is of session 0, or where that
/// is not in the map of the session of the poses. \throws InputError that names what is not there.
template <int D>
std::vector<Key> parse_keys(const std::vector<std::string>& texts, const VariableSet<D>& variables);

/// What --mode means, for the help of the commands that have it.
extern const char* const kModes;

}  // namespace mapjoin::cli
