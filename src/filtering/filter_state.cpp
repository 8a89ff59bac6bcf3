#include "mapjoin/filtering/filter_state.h"

#include <fmt/format.h>

#include <algorithm>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/index.h"

namespace mapjoin {

namespace {

template <class Entry>
bool key_below(const Entry& entry, const Key& key) {
  return entry.first < key;
}

}  // namespace

template <int D>
std::optional<int> FilterState<D>::find(const Key& key) const {
  const auto found =
      std::lower_bound(index_.begin(), index_.end(), key, key_below<std::pair<Key, int>>);
  if (found == index_.end() || found->first != key) return std::nullopt;
  return found->second;
}

template <int D>
int FilterState<D>::require(const Key& key, const char* what) const {
  if (const auto found = find(key)) return *found;
  throw InputError(fmt::format("{}: the map has no variable {}", what, to_string(key)));
}

template <int D>
int FilterState<D>::add(const VariableKind<D>& kind, const Key& key, const double* x) {
  const auto place =
      std::lower_bound(index_.begin(), index_.end(), key, key_below<std::pair<Key, int>>);
  if (place != index_.end() && place->first == key)
    throw InputError(fmt::format("{} is in the map already", to_string(key)));
  const int number = size();
  index_.insert(place, {key, number});
  kinds_.push_back(&kind);
  keys_.push_back(key);
  offset_.push_back(offset_.back() + kind.dim);
  base_.insert(base_.end(), x, x + kind.value_size);
  estimate_.insert(estimate_.end(), x, x + kind.value_size);
  value_start_.push_back(base_.size());
  d_.conservativeResizeLike(Eigen::VectorXd::Zero(scalars()));
  return number;
}

template <int D>
Eigen::MatrixXd FilterState<D>::chart(int i) const {
  Eigen::MatrixXd S(dim(i), dim(i));
  kind(i).local_jacobian(base_.data() + value_start_[at(i)], estimate(i), 1, S.data());
  return S;
}

template <int D>
void FilterState<D>::set_increments(const Eigen::VectorXd& d) {
  d_ = d;
  estimate_ = base_;
  for (int i = 0; i < size(); ++i)
    kind(i).retract(estimate_.data() + value_start_[at(i)], d_.data() + offset(i), 1);
}

template <int D>
void FilterState<D>::rebase() {
  base_ = estimate_;
  d_.setZero();
}

template <int D>
Values<D> FilterState<D>::values() const {
  ValuesBuilder<D> builder;
  for (int i = 0; i < size(); ++i) builder.add(kind(i), key(i), estimate(i));
  return std::move(builder).build();
}

template <int D>
std::vector<int> FilterState<D>::numbers_in(const VariableSet<D>& variables) const {
  std::vector<int> out;
  for (const Key& key : keys_) out.push_back(variables.require(key, "filter"));
  return out;
}

template <int D>
std::optional<Vec<D>> FilterState<D>::position(int i) const {
  if (kind(i).positions == nullptr) return std::nullopt;
  const int first = 0;
  Vec<D> out;
  kind(i).positions(estimate(i), &first, 1, out.data());
  return out;
}

template class FilterState<2>;
template class FilterState<3>;

}  // namespace mapjoin
