#pragma once

#include <string>
#include <vector>

#include "mapjoin/association/association.h"
#include "mapjoin/cli/arguments.h"

namespace mapjoin::cli {

/// What `join` was told.
struct JoinCommand {
  std::vector<std::string> inputs;
  std::string links;
  bool features_only = false;
  std::string merged_list;
  std::string associate = "given";
  double gate = 0.9999;
  double odds = 1000.0;
  double max_distance = 0.0;
  bool check_matches = false;
  bool judge = false;
  JoinArguments join;
};

/// How to associate, in the library's terms, by "nn", "gnn" or "jcbb".
AssociationOptions association_options(const std::string& matcher);
AssociationOptions association_options(const JoinCommand& a);

/// Joins the local maps of a folder.
void join_local_maps(const JoinCommand& a);

}  // namespace mapjoin::cli
