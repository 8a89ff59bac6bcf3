#include "mapjoin/joining/sharing.h"

namespace mapjoin {

template <int D>
Sharing::Sharing(const std::vector<Piece<D>>& pieces, Places& places) {
  std::vector<int> number;  // per variable of any piece: of its holders, then among what is shared
  for (const Piece<D>& piece : pieces) {
    for (const int v : piece.variables) {
      if (places[v] < 0) {
        places.set(v, static_cast<int>(number.size()));
        number.push_back(0);
      }
      ++number[static_cast<std::size_t>(places[v])];
    }
  }
  for (int& n : number) {
    const int count = n;
    n = count > 1 ? variables() : -1;
    if (count > 1) holder_start_.push_back(holder_start_.back() + count);
  }
  holders_.resize(static_cast<std::size_t>(holder_start_.back()));
  shared_.reserve(holders_.size());
  std::vector<std::int64_t> next(holder_start_.begin(), holder_start_.end() - 1);
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    for (int k = 0; k < pieces[p].size(); ++k) {
      const int v = pieces[p].variables[static_cast<std::size_t>(k)];
      const int n = number[static_cast<std::size_t>(places[v])];
      if (n < 0) continue;
      holders_[static_cast<std::size_t>(next[static_cast<std::size_t>(n)]++)] = {
          static_cast<int>(p), k};
      shared_.push_back({k, n});
    }
    start_.push_back(static_cast<std::int64_t>(shared_.size()));
  }
  for (const Piece<D>& piece : pieces) places.clear(piece.variables);
}

template Sharing::Sharing(const std::vector<Piece<2>>&, Places&);
template Sharing::Sharing(const std::vector<Piece<3>>&, Places&);

}  // namespace mapjoin
