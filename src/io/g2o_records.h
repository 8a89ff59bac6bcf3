#pragma once

// The records of a g2o file: what its readers share. Not for users.

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "mapjoin/graph/builtin_types.h"
#include "mapjoin/graph/key.h"
#include "mapjoin/io/g2o.h"
#include "mapjoin/io/text_scanner.h"

namespace mapjoin::detail {

enum class G2oRecord {
  kPoseVertex,
  kPointVertex,
  kPoseEdge,
  kPointEdge,
  kPosePrior,
  kPositionPrior,
  kOffset,
  kFix,
  kUnknown
};

struct G2oTag {
  std::string_view text;
  G2oRecord record = G2oRecord::kUnknown;
  int dimension = 0;  ///< 2, 3, or 0 when the tag does not say
  std::string_view format;
};

/// What a tag means.
const G2oTag& g2o_tag(std::string_view text);

/// A file in memory.
struct G2oText {
  std::string name;
  std::uint32_t session = 0;
  std::string text;
};

/// The first record that says whether the data is of the plane or of space.
struct G2oDimension {
  int dimension = 2;
  std::string tag = "nothing";
  std::string where;
};
G2oDimension g2o_dimension(const std::vector<G2oText>& files);

/// \throws InputError when a tag is of the other dimension.
void require_dimension(const TextScanner& scan, const G2oTag& tag, const G2oDimension& first);

struct G2oId {
  std::uint32_t session = 0;
  std::uint64_t id = 0;

  friend constexpr auto operator<=>(const G2oId&, const G2oId&) = default;
};

/// `17`, `2/17`, or `world`.
G2oId read_g2o_id(TextScanner& scan, std::uint32_t session);

inline Key g2o_pose_key(const G2oId& id) { return pose_key(id.id, id.session); }
/// Subtracts the offset that points were written with. \throws InputError when the id is smaller
/// than that.
Key g2o_point_key(const TextScanner& scan, const G2oId& id, std::uint64_t feature_offset);

template <int D>
Rigid<D> read_g2o_pose(TextScanner& scan) {
  if constexpr (D == 2) {
    const double x = scan.number("x");
    const double y = scan.number("y");
    return rigid2(x, y, scan.number("theta"));
  } else {
    const double x = scan.number("x");
    const double y = scan.number("y");
    const double z = scan.number("z");
    const double qx = scan.number("qx");
    const double qy = scan.number("qy");
    const double qz = scan.number("qz");
    const Eigen::Quaterniond q(scan.number("qw"), qx, qy, qz);
    if (!(q.norm() > 1e-6)) {
      scan.fail("the quaternion qx qy qz qw has length zero and is no rotation",
                "correct it, or write 0 0 0 1 for no rotation");
    }
    return rigid3({x, y, z}, q);
  }
}

template <int D>
Vec<D> read_g2o_point(TextScanner& scan) {
  Vec<D> p;
  p(0) = scan.number("x");
  p(1) = scan.number("y");
  if constexpr (D == 3) p(2) = scan.number("z");
  return p;
}

/// The upper triangle, row by row.
template <int N>
Mat<N, N> read_g2o_information(TextScanner& scan) {
  Mat<N, N> out;
  for (int i = 0; i < N; ++i) {
    for (int j = i; j < N; ++j) out(i, j) = out(j, i) = scan.number("the information matrix");
  }
  return out;
}

/// The vertices of some files.
template <int D>
class G2oVertices {
 public:
  struct Vertex {
    G2oId id;  // as written
    bool is_pose = false;
    Rigid<D> pose;  // of a point: only t
    const G2oText* file = nullptr;
    std::int64_t line = 0;
  };

  /// Reads the rest of a VERTEX line.
  void read(TextScanner& scan, const G2oTag& tag, const G2oText& file);
  /// The one read last.
  const Vertex& last() const { return vertices_.back(); }
  /// Ascending by id, repetitions dropped. \throws InputError when two lines give one vertex two
  /// values or two types.
  const std::vector<Vertex>& sorted();

 private:
  std::vector<Vertex> vertices_;
};

}  // namespace mapjoin::detail
