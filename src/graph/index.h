#pragma once

#include <cstddef>
#include <cstdint>

namespace mapjoin {

/// k as standard containers count. Our own indices are signed, as Eigen's are, so that differences
/// are and -1 can say "none".
constexpr std::size_t at(std::int64_t k) noexcept { return static_cast<std::size_t>(k); }

}  // namespace mapjoin
