#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "mapjoin/cli/watch.h"
#include "mapjoin/evaluation/consistency.h"
#include "mapjoin/evaluation/evaluate.h"
#include "mapjoin/filtering/methods.h"

namespace mapjoin::cli {

/// A method and, of linear joining, its mode.
struct Contestant {
  std::string label;
  Method method = Method::kLinear;
  Mode mode = Mode::kOptimal;
  FilterOptions filter = {};
  bool whole_run = false;  ///< no joining at all: EKF SLAM over the recording
};

/// What data association in a stream found, judged by the numbers of features.
struct MatchScore {
  std::int64_t matches = 0;
  std::int64_t right = 0;
  std::int64_t seen_before = 0;  ///< sightings of features that an earlier local map had
  std::vector<Key> renamed;      ///< in the map under another number than they came with
};

/// What became of one method.
template <int D>
struct Row {
  Contestant contestant;
  FilterResult<D> result;  ///< of a filter over a whole run: a fusion a pose
  double seconds = 0.0;
  std::int64_t memory = 0;
  std::optional<Deviation> deviation;
  std::optional<Consistency> consistency;
  std::optional<Coverage> coverage;
  std::optional<MatchScore> matches;
  std::vector<Watched<D>> watched;
  std::string failure;  ///< what stopped it
};

/// The table that `compare` prints.
template <int D>
std::string text(const std::vector<Row<D>>& rows, bool with_truth, bool associated);

/// One row, with the seconds of every local map (or pose).
template <int D>
nlohmann::ordered_json json(const Row<D>& row);

}  // namespace mapjoin::cli
