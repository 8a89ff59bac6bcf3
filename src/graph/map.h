#pragma once

#include <memory>

#include "mapjoin/graph/anchor.h"
#include "mapjoin/graph/block_matrix.h"
#include "mapjoin/graph/measurement_graph.h"
#include "mapjoin/graph/values.h"

namespace mapjoin {

/// A map: one rigid piece of the world, as an estimate and the information behind it.
///
/// Only relative information is in it; the frame it is written in is a free choice, recorded as the
/// anchor.
template <int D>
struct Map {
  /// The estimate X, written in the anchor's frame.
  Values<D> values;

  /// Gauge-free information over *all* variables, in their tangents at `values`: moving the map
  /// rigidly costs nothing, information * gauge = 0. What the papers call the information matrix I
  /// is this without the anchor's pinned rows and columns. After a summary join it is gauge-free
  /// only to the order of the disagreement of the two maps.
  SymmetricBlockMatrix information;

  /// What fixes the frame of `values`.
  Anchor<D> anchor;

  /// The anchor of the last linear solve: covariances of a map that came from summary joins are
  /// exact in that frame.
  Anchor<D> solved_in;

  /// The measurements and local maps it was made of, when it still carries them: then joining and
  /// refining use those instead of the summary (values, information). Shared, never copied with the
  /// map.
  std::shared_ptr<const MeasurementGraph<D>> observations;

  const VariableSet<D>& variables() const { return values.variables(); }
};

/// A local map as given: an estimate in the frame of its anchor with the information over what the
/// anchor leaves free.
///
/// Terms may repeat a key (two measurements of one variable). The anchor's fully pinned variables
/// need not be terms, unless nothing else says of what type they are; rows and columns of what is
/// pinned are zero.
template <int D>
struct LocalMap {
  Anchor<D> anchor;
  std::vector<const VariableKind<D>*> kinds;  ///< of each term
  std::vector<Key> keys;                      ///< of each term
  std::vector<double> values;                 ///< value_size doubles a term, one after another
  SymmetricBlockMatrix information;           ///< over the terms, in their order

  template <VariableType T>
  void add_term(const Key& key, const ValueOf<T>& value) {
    const auto* x = reinterpret_cast<const double*>(&value);
    kinds.push_back(&kind_of<T>());
    keys.push_back(key);
    values.insert(values.end(), x, x + kValueSize<T>);
  }
};

}  // namespace mapjoin
