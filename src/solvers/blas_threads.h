#pragma once

namespace mapjoin {

/// While one lives, the BLAS that CHOLMOD calls works on one thread (where it is OpenBLAS; the
/// reference BLAS always does). Small dense blocks gain nothing from more, and results must not
/// depend on how many there are.
class SingleThreadedBlas {
 public:
  SingleThreadedBlas();
  ~SingleThreadedBlas();
  SingleThreadedBlas(const SingleThreadedBlas&) = delete;
  SingleThreadedBlas& operator=(const SingleThreadedBlas&) = delete;

 private:
  int before_ = 0;
};

}  // namespace mapjoin
