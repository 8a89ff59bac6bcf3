#include "mapjoin/cli/freed_memory.h"

#include <cstdlib>  // says which C library this is

#if defined(__GLIBC__)
#include <malloc.h>
#endif

namespace mapjoin::cli {

void keep_freed_memory() {
#if defined(__GLIBC__)
  constexpr int kMiB = 1 << 20;
  mallopt(M_MMAP_MAX, 0);         // arrays of more than 32 MiB would come and go, whatever is asked
  mallopt(M_TRIM_THRESHOLD, -1);  // never
  mallopt(M_TOP_PAD, 64 * kMiB);
#endif
}

}  // namespace mapjoin::cli
