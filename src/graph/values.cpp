#include "mapjoin/graph/values.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

namespace mapjoin {

template <int D>
Values<D>::Values(VariableSet<D> variables) : variables_(std::move(variables)) {
  for (const auto& c : variables_.columns()) {
    data_.emplace_back(static_cast<std::size_t>(c.size()) *
                       static_cast<std::size_t>(c.kind->value_size));
  }
}

template <int D>
void Values<D>::transform(const Rigid<D>& T) {
  int at = 0;
  for (const auto& c : variables_.columns()) c.kind->transform(T, data(at++), c.keys.size());
}

template <int D>
void Values<D>::retract(std::span<const double> d) {
  int at = 0;
  for (const auto& c : variables_.columns())
    c.kind->retract(data(at++), d.data() + c.first_scalar, c.keys.size());
}

template <int D>
Eigen::VectorXd Values<D>::local(const Values& other) const {
  if (!(variables_ == other.variables_))
    throw InputError("local: the two sets of values are of different variables");
  Eigen::VectorXd d(variables_.scalars());
  int at = 0;
  for (const auto& c : variables_.columns()) {
    c.kind->local(data(at), other.data(at), c.keys.size(), d.data() + c.first_scalar);
    ++at;
  }
  return d;
}

template <int D>
Eigen::MatrixXd Values<D>::gauge() const {
  constexpr int G = kGauge<D>;
  Eigen::MatrixXd g(variables_.scalars(), G);
  std::vector<double> rows;
  int at = 0;
  for (const auto& c : variables_.columns()) {
    const std::ptrdiff_t block = c.kind->dim * G;
    rows.resize(c.keys.size() * static_cast<std::size_t>(block));
    c.kind->gauge(data(at++), c.keys.size(), rows.data());
    for (int k = 0; k < c.size(); ++k) {
      g.middleRows(c.first_scalar + k * c.kind->dim, c.kind->dim) =
          Eigen::Map<const Eigen::MatrixXd>(rows.data() + k * block, c.kind->dim, G);
    }
  }
  return g;
}

template <int D>
void ValuesBuilder<D>::add(const VariableKind<D>& kind, const Key& key, const double* x) {
  auto at = std::find_if(columns_.begin(), columns_.end(),
                         [&](const Column& c) { return c.kind->tag == kind.tag; });
  if (at == columns_.end()) {
    columns_.push_back({&kind, {}, {}});
    at = columns_.end() - 1;
  }
  at->keys.push_back(key);
  at->data.insert(at->data.end(), x, x + kind.value_size);
}

template <int D>
Values<D> ValuesBuilder<D>::build() && {
  std::vector<typename VariableSet<D>::Column> sets;
  for (const Column& c : columns_) sets.push_back({c.kind, c.keys, 0, 0});
  Values<D> out{VariableSet<D>(std::move(sets))};
  for (const Column& c : columns_) {
    const int to = out.variables().find_column(c.kind->tag);
    std::vector<int> order(c.keys.size());
    std::iota(order.begin(), order.end(), 0);
    const auto key = [&](int k) -> const Key& { return c.keys[static_cast<std::size_t>(k)]; };
    std::sort(order.begin(), order.end(), [&](int a, int b) { return key(a) < key(b); });
    double* data = out.data(to);
    const auto size = static_cast<std::size_t>(c.kind->value_size);
    for (std::size_t k = 0; k < order.size(); ++k) {
      if (k > 0 && key(order[k]) == key(order[k - 1])) {
        throw InputError(fmt::format("variable {} is given twice", to_string(key(order[k]))));
      }
      const double* x = c.data.data() + static_cast<std::size_t>(order[k]) * size;
      if (!std::all_of(x, x + size, [](double v) { return std::isfinite(v); })) {
        throw InputError(fmt::format("the value of {} is not finite", to_string(key(order[k]))));
      }
      std::memcpy(data + k * size, x, size * sizeof(double));
    }
  }
  return out;
}

template <int D>
Values<D> subset(const Values<D>& all, std::span<const int> numbers) {
  Values<D> out{subset(all.variables(), numbers)};
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    const int size = out.variables().kind(static_cast<int>(k)).value_size;
    std::memcpy(out.value(static_cast<int>(k)), all.value(numbers[k]),
                static_cast<std::size_t>(size) * sizeof(double));
  }
  return out;
}

template class Values<2>;
template class Values<3>;
template class ValuesBuilder<2>;
template class ValuesBuilder<3>;
template Values<2> subset<2>(const Values<2>&, std::span<const int>);
template Values<3> subset<3>(const Values<3>&, std::span<const int>);

}  // namespace mapjoin
