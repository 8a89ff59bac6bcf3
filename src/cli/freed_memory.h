#pragma once

namespace mapjoin::cli {

/// Has the C library keep what is freed for the next who asks, instead of giving large arrays back
/// to the system each time: fresh pages are zeroed on their first touch, and threads wait for one
/// another to get them. Of a million poses on two threads it takes a tenth of the time, for one per
/// cent more memory. A matter of the whole process, so for programs, not for libraries.
void keep_freed_memory();

}  // namespace mapjoin::cli
