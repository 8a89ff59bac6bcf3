#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mapjoin/association/association.h"
#include "mapjoin/cli/compare_table.h"

namespace mapjoin::cli {

/// The methods of a list, as the user wrote it; "all" of them. \throws InputError when there is no
/// such method, or when it needs a recording and there is none.
std::vector<Contestant> contestants(const std::string& list, bool recording);

/// Runs one method, with the clock and an eye on the memory. Errors of the method are in the row.
/// With an association, features are matched as the local maps arrive, whatever their numbers say;
/// these judge the matches. \throws CancelledError.
template <int D>
Row<D> run_one(const Contestant& contestant, const Subject<D>& subject,
               const std::optional<AssociationOptions>& association);

}  // namespace mapjoin::cli
