#include "mapjoin/io/native_observations.h"

#include <algorithm>

#include <cstdint>
#include <vector>

#include "mapjoin/io/native_layout.h"

namespace mapjoin::detail {

namespace {

template <int D>
class ObservationsReader {
 public:
  ObservationsReader(ByteReader& in, const FileTypes<D>& types) : in_(in), types_(types) {}

  MeasurementGraph<D> read() {
    graph_.variables = read_variables(in_, types_);
    pose_column_ = graph_.variables.find_column(Tag("pose"));
    const std::size_t columns = in_.count("columns of measurements", 40);
    for (std::size_t c = 0; c < columns; ++c) read_relative();
    read_submaps();
    in_.expect_end();
    return std::move(graph_);
  }

 private:
  bool is_of(std::int32_t variable, int column) const {
    if (column < 0 || variable < 0) return false;
    const auto& c = graph_.variables.column(column);
    return variable >= c.first && variable < c.end();
  }

  void read_relative() {
    RelativeMeasurements<D> m;
    m.kind = &types_.variable(in_);
    m.from = in_.array<std::int32_t>("poses of measurements");
    m.to = in_.array<std::int32_t>("variables of measurements");
    m.z = in_.array<double>("measurements");
    m.info = in_.array<double>("information of measurements");
    const std::size_t n = m.from.size();
    const auto dim = static_cast<std::size_t>(m.kind->dim);
    in_.require(m.to.size() == n &&
                    m.z.size() == n * static_cast<std::size_t>(m.kind->value_size) &&
                    m.info.size() == n * dim * dim,
                "measurements have columns of different length");
    const int column = graph_.variables.find_column(m.kind->tag);
    for (std::size_t k = 0; k < n; ++k) {
      in_.require(is_of(m.from[k], pose_column_) && is_of(m.to[k], column) && m.from[k] != m.to[k],
                  "a measurement is of a variable that is not there");
    }
    in_.require(graph_.relative.empty() || graph_.relative.back().kind->tag < m.kind->tag,
                "measurements do not stand in the order of their types");
    graph_.relative.push_back(std::move(m));
  }

  void read_submaps() {
    SubmapObservations<D>& maps = graph_.submaps;
    for (const std::uint32_t number : in_.array<std::uint32_t>("anchors")) {
      in_.require(number < types_.anchors().size(),
                  "the number of an anchor kind is not in the table of types");
      maps.anchors.push_back(types_.anchors()[number]);
    }
    for_each_submap_array(maps, [&]<class T>(std::vector<T>& array, const char* what) {
      array = in_.array<T>(what);
    });
    check_starts(maps.anchor_start, maps.anchor_variables.size());
    check_starts(maps.term_start, maps.term_variable.size());
    check_starts(maps.block_start, maps.block_row.size());
    in_.require(maps.term_value.size() == maps.term_variable.size() &&
                    maps.block_column.size() == maps.block_row.size() &&
                    maps.block_value.size() == maps.block_row.size(),
                "observations have columns of different length");
    for (std::size_t k = 0; k < maps.size(); ++k) {
      check_anchor(k);
      check_terms(k);
      check_blocks(k);
    }
  }

  void check_starts(const std::vector<std::int64_t>& start, std::size_t end) const {
    in_.require(start.size() == graph_.submaps.size() + 1 && start.front() == 0 &&
                    start.back() == static_cast<std::int64_t>(end) &&
                    std::is_sorted(start.begin(), start.end()),
                "observations do not begin where they should");
  }

  static bool fits(std::int64_t first, std::int64_t count, const std::vector<double>& numbers) {
    return first >= 0 && first <= static_cast<std::int64_t>(numbers.size()) - count;
  }

  void check_anchor(std::size_t k) const {
    const auto& maps = graph_.submaps;
    const std::int64_t first = maps.anchor_start[k];
    const std::int64_t count = maps.anchor_start[k + 1] - first;
    in_.require(count == maps.anchors[k]->arity,
                "an observation's anchor has another number of variables than its kind");
    for (std::int64_t a = 0; a < count; ++a) {
      const int column = graph_.variables.find_column(maps.anchors[k]->types[a]);
      in_.require(is_of(maps.anchor_variables[static_cast<std::size_t>(first + a)], column),
                  "an observation's anchor is a variable that is not there");
    }
  }

  void check_terms(std::size_t k) const {
    const auto& maps = graph_.submaps;
    for (std::int64_t t = maps.term_start[k]; t < maps.term_start[k + 1]; ++t) {
      const auto at = static_cast<std::size_t>(t);
      const std::int32_t v = maps.term_variable[at];
      in_.require(v >= 0 && v < graph_.variables.size(),
                  "an observation is of a variable that is not there");
      in_.require(t == maps.term_start[k] || maps.term_variable[at - 1] <= v,
                  "the variables of an observation do not ascend");
      in_.require(fits(maps.term_value[at], graph_.variables.kind(v).value_size, maps.values),
                  "a value lies outside the file");
    }
  }

  void check_blocks(std::size_t k) const {
    const auto& maps = graph_.submaps;
    const std::int64_t first = maps.term_start[k];
    const std::int64_t terms = maps.term_start[k + 1] - first;
    const auto dim = [&](std::int32_t term) {
      return std::int64_t{
          graph_.variables.dim(maps.term_variable[static_cast<std::size_t>(first + term)])};
    };
    for (auto b = static_cast<std::size_t>(maps.block_start[k]);
         b < static_cast<std::size_t>(maps.block_start[k + 1]); ++b) {
      const std::int32_t row = maps.block_row[b];
      const std::int32_t column = maps.block_column[b];
      in_.require(column >= 0 && row >= column && row < terms,
                  "a block of information is of a variable that is not observed");
      in_.require(fits(maps.block_value[b], dim(row) * dim(column), maps.information),
                  "a block of information lies outside the file");
    }
  }

  ByteReader& in_;
  const FileTypes<D>& types_;
  MeasurementGraph<D> graph_;
  int pose_column_ = -1;
};

}  // namespace

template <int D>
MeasurementGraph<D> read_observations(ByteReader in, const FileTypes<D>& types) {
  return ObservationsReader<D>(in, types).read();
}

template MeasurementGraph<2> read_observations<2>(ByteReader, const FileTypes<2>&);
template MeasurementGraph<3> read_observations<3>(ByteReader, const FileTypes<3>&);

}  // namespace mapjoin::detail
