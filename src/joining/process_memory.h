#pragma once

#include <cstdint>

/// \file
/// What the system says about this process's memory, in bytes.

namespace mapjoin {

/// What is resident now; 0 where the system does not say.
std::int64_t resident_memory();

/// The most that has been resident since the process, or the last reset_peak_memory(), began.
std::int64_t peak_memory();

/// Lets the peak begin anew at what is in use. False, and the peak goes on, where the system does
/// not let us.
bool reset_peak_memory();

}  // namespace mapjoin
