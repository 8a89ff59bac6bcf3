#pragma once

#include <mutex>

namespace mapjoin {

/// Held while METIS is called: it seeds and draws from the random numbers of the C library, which
/// the whole process has in common, so two calls at once would disturb one another's results. A
/// program that draws from them meanwhile still does.
class MetisTurn {
 public:
  MetisTurn();

 private:
  std::unique_lock<std::mutex> lock_;
};

}  // namespace mapjoin
