#pragma once

#include <thread>

namespace mapjoin {

/// How a thread passes the time until another one is ready: at first without leaving its core, then
/// giving it away, as there may be fewer cores than threads.
class Patience {
 public:
  void wait() {
    if (++rounds_ <= kPauses) {
#if defined(__x86_64__) || defined(__i386__)
      __builtin_ia32_pause();
#endif
    } else {
      std::this_thread::yield();
    }
  }
  /// False once it has waited for as long as it takes to put a thread to sleep and to wake it, some
  /// tens of microseconds: what lasts longer is better slept through.
  bool lasts() const { return rounds_ < kPauses + kYields; }
  void renew() { rounds_ = 0; }

 private:
  static constexpr int kPauses = 512;
  static constexpr int kYields = 128;
  int rounds_ = 0;
};

}  // namespace mapjoin
