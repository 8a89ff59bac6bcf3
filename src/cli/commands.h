#pragma once

#include "mapjoin/cli/command.h"

namespace mapjoin::cli {

// Each adds a subcommand, which runs when the command line names it.
void add_build(Command& app);
void add_solve(Command& app);
void add_join(Command& app);
void add_reframe(Command& app);
void add_marginalize(Command& app);
void add_compare(Command& app);
void add_covariance(Command& app);
void add_evaluate(Command& app);
void add_simulate(Command& app);
void add_info(Command& app);
void add_demo(Command& app);

}  // namespace mapjoin::cli
