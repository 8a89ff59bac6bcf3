#include "benchmarks/measure.h"

#include <dlfcn.h>
#include <malloc.h>
#include <sched.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <numeric>

#include "mapjoin/joining/process_memory.h"

namespace mapjoin::benchmarks {

namespace {

/// The processors that this program was given, and the one of them for single-threaded work.
struct Processors {
  cpu_set_t all;
  cpu_set_t one;

  Processors() {
    CPU_ZERO(&all);
    CPU_ZERO(&one);
    sched_getaffinity(0, sizeof all, &all);
    CPU_SET(static_cast<std::size_t>(std::max(0, sched_getcpu())), &one);
  }
};

const Processors& processors() {
  static const Processors found;
  return found;
}

/// OpenBLAS, where that is the BLAS: others have no threads, or keep to the environment.
template <class Function>
Function* openblas(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_DEFAULT, name));
}

/// For all threads that there are: those that BLAS keeps, too, were started under some allowance.
void move_to(const cpu_set_t& set) {
  std::error_code ignored;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task", ignored)) {
    sched_setaffinity(static_cast<pid_t>(std::stol(task.path().filename())), sizeof set, &set);
  }
}

double processor_seconds() {
  timespec t = {};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

template <class Of>
double median_of(const std::vector<Measured>& runs, Of of) {
  std::vector<double> samples;
  for (const Measured& run : runs) samples.push_back(of(run));
  return median(std::move(samples));
}

/// One contender's runs in a round of so many seconds.
class Round {
 public:
  explicit Round(double seconds) : seconds_(seconds) {}

  /// Does another run fit, if it takes as long as those before?
  bool has_room() const {
    const auto count = static_cast<double>(runs_.size());
    return runs_.empty() || used_ * (1.0 + 1.0 / count) < seconds_;
  }
  /// A turn: a part of the round, one run at least.
  void run(const Contender& contender) {
    constexpr double kTurns = 4.0;
    const Allowance allowance(contender.threads);
    const Laps watch;
    const double before = used_;
    do {
      runs_.push_back(contender.run());
      used_ = before + watch.now();
    } while (has_room() && watch.now() < seconds_ / kTurns);
  }
  /// The middle one of the runs.
  Measured result() && {
    const auto middle = runs_.begin() + static_cast<std::ptrdiff_t>(runs_.size() / 2);
    std::nth_element(runs_.begin(), middle, runs_.end(), [](const Measured& a, const Measured& b) {
      return a.seconds() < b.seconds();
    });
    return std::move(*middle);
  }

 private:
  double seconds_;
  double used_ = 0.0;
  std::vector<Measured> runs_;
};

}  // namespace

double median(std::vector<double> samples) {
  const std::size_t middle = samples.size() / 2;
  std::sort(samples.begin(), samples.end());
  return samples.size() % 2 == 1 ? samples[middle] : 0.5 * (samples[middle - 1] + samples[middle]);
}

double Measured::seconds() const { return std::accumulate(phases.begin(), phases.end(), 0.0); }

Laps::Laps() : start_(std::chrono::steady_clock::now()), cpu_start_(processor_seconds()) {}

double Laps::now() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

double Laps::cpu_now() const { return processor_seconds() - cpu_start_; }

void Laps::lap() {
  const double t = now();
  phases_.push_back(t - last_);
  last_ = t;
  cpu_ = cpu_now();
}

double Contender::seconds() const {
  return median_of(runs, [](const Measured& m) { return m.seconds(); });
}

double Contender::cpu_seconds() const {
  return median_of(runs, [](const Measured& m) { return m.cpu; });
}

double times_as_fast(const Contender& one, const Contender& other) {
  std::vector<double> rounds;
  for (auto a = one.runs.begin(), b = other.runs.begin();
       a != one.runs.end() && b != other.runs.end();) {
    if (a->round == b->round) rounds.push_back(b->seconds() / a->seconds());
    (a->round <= b->round ? a : b)++;
  }
  return rounds.empty() ? other.seconds() / one.seconds() : median(std::move(rounds));
}

std::vector<double> Contender::phase_seconds() const {
  std::vector<double> out;
  for (std::size_t p = 0; p < runs.front().phases.size(); ++p) {
    out.push_back(median_of(runs, [p](const Measured& m) { return m.phases[p]; }));
  }
  return out;
}

std::string blas_in_use() {
  void* const function = dlsym(RTLD_DEFAULT, "dgemm_");
  Dl_info info = {};
  if (function == nullptr || dladdr(function, &info) == 0 || info.dli_fname == nullptr) {
    return "unknown";
  }
  std::error_code failed;
  const auto file = std::filesystem::canonical(info.dli_fname, failed);
  return failed ? info.dli_fname : file.string();
}

Allowance::Allowance(int threads) {
  move_to(threads == 1 ? processors().one : processors().all);
  if (auto* const get = openblas<int()>("openblas_get_num_threads")) blas_before_ = get();
  if (auto* const set_blas = openblas<void(int)>("openblas_set_num_threads")) set_blas(threads);
}

Allowance::~Allowance() {
  if (auto* const set_blas = openblas<void(int)>("openblas_set_num_threads")) {
    set_blas(std::max(1, blas_before_));
  }
  move_to(processors().all);
}

Race::Race(std::vector<Contender> contenders, double slow, double round)
    : contenders_(std::move(contenders)), round_(round) {
  constexpr double kWarmAlone = 2.0;  // seconds in which what a run finds cold is soon forgotten
  for (std::size_t k = 0; k < contenders_.size(); ++k) {
    Contender& c = contenders_[k];
    const Allowance allowance(c.threads);
    malloc_trim(0);  // else earlier runs' memory, freed but kept, hides what a run takes
    const bool measurable = reset_peak_memory();
    const std::int64_t before = resident_memory();
    Measured first = c.run();
    if (measurable && before > 0) c.peak_bytes = std::max<std::int64_t>(0, peak_memory() - before);
    if (first.seconds() > slow) {
      c.runs.push_back(std::move(first));
      continue;
    }
    const bool quick = first.seconds() < kWarmAlone;
    racing_.push_back({k, quick});
    if (c.often && quick) often_.push_back(racing_.back());
  }
}

void Race::run(const std::vector<Entry>& entries) {
  for (const Entry& entry : entries) {
    if (!entry.warms_up) continue;
    const Allowance allowance(contenders_[entry.contender].threads);
    contenders_[entry.contender].run();
  }
  std::vector<Round> rounds(entries.size(), Round(round_));
  for (bool more = true; more;) {
    more = false;
    for (std::size_t k = 0; k < entries.size(); ++k) {
      if (!rounds[k].has_room()) continue;
      rounds[k].run(contenders_[entries[k].contender]);
      more = true;
    }
  }
  ++round_number_;
  for (std::size_t k = 0; k < entries.size(); ++k) {
    std::vector<Measured>& runs = contenders_[entries[k].contender].runs;
    runs.push_back(std::move(rounds[k]).result());
    runs.back().round = round_number_;
  }
}

std::vector<Contender> Race::finish() && {
  for (Contender& c : contenders_) c.run = nullptr;
  return std::move(contenders_);
}

}  // namespace mapjoin::benchmarks
