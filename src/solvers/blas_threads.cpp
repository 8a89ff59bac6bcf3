#include "mapjoin/solvers/blas_threads.h"

#include <dlfcn.h>

namespace mapjoin {

namespace {

template <class Function>
Function* find(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_DEFAULT, name));
}

}  // namespace

SingleThreadedBlas::SingleThreadedBlas() {
  auto* const get = find<int()>("openblas_get_num_threads");
  auto* const set = find<void(int)>("openblas_set_num_threads");
  if (get == nullptr || set == nullptr) return;
  before_ = get();
  if (before_ > 1) set(1);
}

SingleThreadedBlas::~SingleThreadedBlas() {
  if (before_ <= 1) return;
  if (auto* const set = find<void(int)>("openblas_set_num_threads")) set(before_);
}

}  // namespace mapjoin
