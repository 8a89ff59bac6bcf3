#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace mapjoin {

/// Reproducible random numbers: xoshiro256** (Blackman and Vigna), seeded by splitmix64.
///
/// The generators of the standard library are the same everywhere but its distributions are not, so
/// a world made with one standard library would differ from the "same" world made with another.
/// Streams of one seed are independent: drawing more noise does not move the walls.
class Random {
 public:
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0) {
    std::uint64_t x = seed + stream * 0xd1342543de82ef95ULL;
    for (std::uint64_t& s : state_) s = mix(x += 0x9e3779b97f4a7c15ULL);
  }

  /// The output function of splitmix64: a good hash of 64 bits.
  static constexpr std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }

  std::uint64_t bits() {
    const std::uint64_t out = std::rotl(state_[1] * 5, 7) * 9;
    const std::uint64_t t = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= t;
    state_[3] = std::rotl(state_[3], 45);
    return out;
  }
  /// Uniform in [0, 1).
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1.0p-53; }
  /// Uniform in 0 .. n-1; n far below 2^32.
  int below(int n) {
    return static_cast<int>((static_cast<std::uint64_t>(n) * (bits() >> 32)) >> 32);
  }
  /// Standard normal, by Box and Muller; every second one is left over from the one before.
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double r = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    const double angle = 2.0 * std::numbers::pi * uniform();
    spare_ = r * std::sin(angle);
    has_spare_ = true;
    return r * std::cos(angle);
  }

 private:
  std::array<std::uint64_t, 4> state_{};
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace mapjoin
