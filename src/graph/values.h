#pragma once

#include <Eigen/Core>
#include <span>
#include <utility>
#include <vector>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/variables.h"

namespace mapjoin {

/// Values of a set of variables: one contiguous array a type.
template <int D>
class Values {
 public:
  Values() = default;
  /// All values zero bytes until set. Mostly used through ValuesBuilder.
  explicit Values(VariableSet<D> variables);

  const VariableSet<D>& variables() const { return variables_; }
  int size() const { return variables_.size(); }
  bool contains(const Key& key) const { return variables_.find(key).has_value(); }

  /// The whole column of a type, in ascending order of keys; empty when there is none.
  template <VariableType T>
  std::span<const ValueOf<T>> column() const {
    const int c = variables_.find_column(Tag(T::name));
    if (c < 0) return {};
    return {reinterpret_cast<const ValueOf<T>*>(data(c)),
            static_cast<std::size_t>(variables_.column(c).size())};
  }
  /// One value. \throws InputError when the map has no such variable.
  template <VariableType T>
  const ValueOf<T>& at(const Key& key) const {
    if (key.type != Tag(T::name))
      throw InputError(to_string(key) + " is not of type " + std::string(T::name));
    return *reinterpret_cast<const ValueOf<T>*>(value(variables_.require(key, "value")));
  }
  const Rigid<D>& pose(const Key& key) const { return at<PoseType<D>>(key); }
  const Vec<D>& point(const Key& key) const { return at<PointType<D>>(key); }

  /// The doubles of column c, and of variable i.
  const double* data(int c) const { return data_[static_cast<std::size_t>(c)].data(); }
  double* data(int c) { return data_[static_cast<std::size_t>(c)].data(); }
  const double* value(int i) const {
    const int c = variables_.column_of(i);
    return data(c) + static_cast<std::ptrdiff_t>(i - variables_.column(c).first) *
                         variables_.column(c).kind->value_size;
  }
  double* value(int i) { return const_cast<double*>(std::as_const(*this).value(i)); }
  /// Variable i, which is a pose.
  const Rigid<D>& pose(int i) const { return *reinterpret_cast<const Rigid<D>*>(value(i)); }
  Rigid<D>& pose(int i) { return *reinterpret_cast<Rigid<D>*>(value(i)); }
  template <VariableType T>
  void set(int i, const ValueOf<T>& x) {
    *reinterpret_cast<ValueOf<T>*>(value(i)) = x;
  }

  /// Moves everything: x = T x. O(n).
  void transform(const Rigid<D>& T);
  /// x = x [+] d, d of variables().scalars() numbers. O(n).
  void retract(std::span<const double> d);
  /// d with x [+] d = other, for values of the same variables. O(n).
  Eigen::VectorXd local(const Values& other) const;
  /// g stacked: scalars() x kGauge<D>. O(n).
  Eigen::MatrixXd gauge() const;

 private:
  VariableSet<D> variables_;
  std::vector<std::vector<double>> data_;
};

/// Collects values in any order.
template <int D>
class ValuesBuilder {
 public:
  template <VariableType T>
  void add(const Key& key, const ValueOf<T>& x) {
    add(kind_of<T>(), key, reinterpret_cast<const double*>(&x));
  }
  void add(const VariableKind<D>& kind, const Key& key, const double* x);
  /// \throws InputError that names a key added twice or a value that is not finite. O(n log n).
  Values<D> build() &&;

 private:
  struct Column {
    const VariableKind<D>* kind;
    std::vector<Key> keys;
    std::vector<double> data;
  };
  std::vector<Column> columns_;
};

/// The values of a subset of variables, given by ascending numbers.
template <int D>
Values<D> subset(const Values<D>& all, std::span<const int> numbers);

extern template class Values<2>;
extern template class Values<3>;
extern template class ValuesBuilder<2>;
extern template class ValuesBuilder<3>;

}  // namespace mapjoin
