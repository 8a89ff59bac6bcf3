#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapjoin/graph/piece.h"

namespace mapjoin {

/// Which pieces hold the variables that more than one of them holds.
class Sharing {
 public:
  struct Holder {
    int piece = -1;
    int place = 0;  ///< of the variable in that piece
  };
  struct Shared {
    int place;   ///< in the piece
    int number;  ///< of the variable among those that are shared
  };

  /// `places` is a work array, as it was afterwards. Cost: linear in what the pieces hold.
  template <int D>
  Sharing(const std::vector<Piece<D>>& pieces, Places& places);

  int variables() const { return static_cast<int>(holder_start_.size()) - 1; }
  /// By piece.
  std::span<const Holder> holders(int variable) const {
    return part_of<Holder>(holders_, holder_start_, variable);
  }
  /// What a piece shares, by place.
  std::span<const Shared> of(int piece) const { return part_of<Shared>(shared_, start_, piece); }

 private:
  template <class T>
  static std::span<const T> part_of(const std::vector<T>& all,
                                    const std::vector<std::int64_t>& start, int k) {
    const auto i = static_cast<std::size_t>(k);
    return std::span(all).subspan(static_cast<std::size_t>(start[i]),
                                  static_cast<std::size_t>(start[i + 1] - start[i]));
  }

  std::vector<std::int64_t> holder_start_{0}, start_{0};
  std::vector<Holder> holders_;
  std::vector<Shared> shared_;
};

}  // namespace mapjoin
