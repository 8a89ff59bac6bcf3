// Vectors of doubles, as wide as the registers that the compiler may use.
#pragma once

namespace mapjoin {

/// Doubles in a register: 8 with AVX-512 (asked for by a feature that implies it), else 4, or two
/// registers of 2. Never wider: compilers split arithmetic on wider vectors well, but carry the
/// vectors themselves through memory, two words at a time.
#if defined(__AVX512VL__)
inline constexpr int kLanes = 8;
#else
inline constexpr int kLanes = 4;
#endif

using Lanes = double __attribute__((vector_size(kLanes * sizeof(double)), may_alias));
/// The same, anywhere.
using UnalignedLanes =
    double __attribute__((vector_size(kLanes * sizeof(double)), aligned(8), may_alias));

}  // namespace mapjoin
