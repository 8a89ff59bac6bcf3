#include "mapjoin/association/assignment.h"

#include <fmt/format.h>

#include <limits>

#include "mapjoin/graph/error.h"

namespace mapjoin {

namespace {

/// Rows are added one by one. Potentials u of rows and v of columns keep cost - u - v from being
/// negative, and zero where a row has its column.
class Hungarian {
 public:
  explicit Hungarian(const Eigen::MatrixXd& cost)
      : cost_(cost), u_(cost.rows(), 0.0), v_(cost.cols(), 0.0), row_of_(cost.cols(), -1) {}

  void add(int row) {
    // Dijkstra from the row over reduced costs, to the nearest column without a row.
    const auto columns = static_cast<std::size_t>(cost_.cols());
    std::vector<double> distance(columns, std::numeric_limits<double>::infinity());
    std::vector<int> before(columns, -1);  // the column that a column was reached from
    std::vector<bool> done(columns, false);
    int i = row, last = -1;
    double reached = 0.0;
    for (;;) {
      int next = -1;
      for (std::size_t j = 0; j < columns; ++j) {
        if (done[j]) continue;
        const double d = reached + reduced(i, static_cast<int>(j));
        if (d < distance[j]) {
          distance[j] = d;
          before[j] = last;
        }
        if (next < 0 || distance[j] < distance[static_cast<std::size_t>(next)])
          next = static_cast<int>(j);
      }
      reached = distance[static_cast<std::size_t>(next)];
      done[static_cast<std::size_t>(next)] = true;
      last = next;
      i = row_of_[static_cast<std::size_t>(next)];
      if (i < 0) break;
    }
    u_[static_cast<std::size_t>(row)] += reached;
    for (std::size_t j = 0; j < columns; ++j) {
      if (!done[j]) continue;
      v_[j] -= reached - distance[j];
      if (row_of_[j] >= 0) u_[static_cast<std::size_t>(row_of_[j])] += reached - distance[j];
    }
    while (last >= 0) {  // hand the columns on along the path
      const int from = before[static_cast<std::size_t>(last)];
      row_of_[static_cast<std::size_t>(last)] =
          from < 0 ? row : row_of_[static_cast<std::size_t>(from)];
      last = from;
    }
  }

  std::vector<int> columns() const {
    std::vector<int> out(u_.size(), -1);
    for (std::size_t j = 0; j < row_of_.size(); ++j) {
      if (row_of_[j] >= 0) out[static_cast<std::size_t>(row_of_[j])] = static_cast<int>(j);
    }
    return out;
  }

 private:
  double reduced(int i, int j) const {
    return cost_(i, j) - u_[static_cast<std::size_t>(i)] - v_[static_cast<std::size_t>(j)];
  }

  const Eigen::MatrixXd& cost_;
  std::vector<double> u_, v_;
  std::vector<int> row_of_;
};

}  // namespace

std::vector<int> assign(const Eigen::MatrixXd& cost) {
  if (cost.cols() < cost.rows()) {
    throw InputError(fmt::format(
        "an assignment of {} rows to {} columns leaves rows without one: add columns for 'none'",
        cost.rows(), cost.cols()));
  }
  if (!cost.allFinite())
    throw InputError("a cost is not finite: write a large number for what must not be");
  Hungarian method(cost);
  for (int i = 0; i < cost.rows(); ++i) method.add(i);
  return method.columns();
}

}  // namespace mapjoin
