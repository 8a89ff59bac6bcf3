// Reading and writing, in bytes a second. The files are in the cache of the operating system.
#include <benchmark/benchmark.h>

#include <unistd.h>

#include <filesystem>

#include "benchmarks/worlds.h"
#include "mapjoin/graph/error.h"
#include "mapjoin/io/g2o.h"
#include "mapjoin/io/native_map.h"

namespace mapjoin::benchmarks {

namespace {

/// A file's place for as long as one kernel runs.
class ScratchFile {
 public:
  explicit ScratchFile(const std::string& extension)
      : path_(std::filesystem::temp_directory_path() /
              ("mapjoin_kernels_" + std::to_string(getpid()) + extension)) {}
  ~ScratchFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  void count_bytes(benchmark::State& state) const {
    state.SetBytesProcessed(state.iterations() *
                            static_cast<std::int64_t>(std::filesystem::file_size(path_)));
  }

 private:
  std::filesystem::path path_;
};

template <int D>
void read_measurements_g2o(benchmark::State& state) {
  const ScratchFile file(".g2o");
  write_g2o(file.path(), SolvedWorld<D>::of_size(state.range(0)).graph);
  for (auto _ : state) benchmark::DoNotOptimize(read_g2o(file.path()).dimension);
  file.count_bytes(state);
}
MAPJOIN_KERNEL(read_measurements_g2o);

template <int D>
void write_measurements_g2o(benchmark::State& state) {
  const ScratchFile file(".g2o");
  for (auto _ : state) write_g2o(file.path(), SolvedWorld<D>::of_size(state.range(0)).graph);
  file.count_bytes(state);
}
MAPJOIN_KERNEL(write_measurements_g2o);

template <int D>
void read_native_map(benchmark::State& state) {
  const ScratchFile file(".map");
  write_map(file.path(), SolvedWorld<D>::of_size(state.range(0)).map);
  for (auto _ : state) benchmark::DoNotOptimize(read_map<D>(file.path()).values.size());
  file.count_bytes(state);
}
MAPJOIN_KERNEL(read_native_map);

template <int D>
void write_native_map(benchmark::State& state) {
  const ScratchFile file(".map");
  for (auto _ : state) write_map(file.path(), SolvedWorld<D>::of_size(state.range(0)).map);
  file.count_bytes(state);
}
MAPJOIN_KERNEL(write_native_map);

}  // namespace

}  // namespace mapjoin::benchmarks
