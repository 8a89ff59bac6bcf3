#pragma once

#include <vector>

#include "mapjoin/graph/key.h"
#include "mapjoin/graph/rigid.h"

namespace mapjoin {

/// A way to fix a frame by variables: what an anchor of this kind pins, and where its frame is.
///
/// `values[k]` are the doubles of the value of the anchor's k-th key; tangents of the keys are
/// stacked in that order. A kind is a constant that lives as long as the program; anchors point at
/// it. Kinds are told apart by their tags. Everything works with kinds of a user's own: see
/// examples/05_own_anchor.cpp; frames/testing/anchor_conformance.h tests them.
template <int D>
struct AnchorKind {
  Tag tag;
  int arity = 0;               ///< number of keys
  const Tag* types = nullptr;  ///< the type of each key
  int tangent = 0;             ///< number of stacked tangent scalars
  /// The rigid motion into the frame; frame(T x) = frame(x) T^-1. \throws DegenerateFrameError.
  Rigid<D> (*frame)(const double* const* values, const Key* keys) = nullptr;
  /// P, kGauge<D> x tangent, column-major, for values written in the frame: P d = 0 keeps the
  /// frame.
  void (*rows)(const double* const* values, double* P) = nullptr;
  /// Sets the pinned coordinates of values written in the frame to exactly what the frame says they
  /// are. Where a variable is pinned whole, that is its value, whatever it was before.
  void (*pin)(double* const* values) = nullptr;
};

/// What fixes a map's frame: a kind and its variables.
template <int D>
struct Anchor {
  const AnchorKind<D>* kind = nullptr;
  std::vector<Key> keys;

  friend bool operator==(const Anchor& a, const Anchor& b) {
    return a.keys == b.keys && (a.kind == b.kind || (a.kind != nullptr && b.kind != nullptr &&
                                                     a.kind->tag == b.kind->tag));
  }
};

}  // namespace mapjoin
