#include "mapjoin/solvers/metis_turn.h"

namespace mapjoin {

namespace {

std::mutex metis_in_use;

}  // namespace

MetisTurn::MetisTurn() : lock_(metis_in_use) {}

}  // namespace mapjoin
