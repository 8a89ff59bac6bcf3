#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

#include "mapjoin/graph/key.h"
#include "mapjoin/graph/measurement_graph.h"
#include "mapjoin/graph/values.h"
#include "mapjoin/io/information_policy.h"

/// \file
/// Measurement graphs and solutions in the text format of g2o.
///
///     VERTEX_SE2 id  x y theta
///     VERTEX_XY id  x y
///     VERTEX_SE3:QUAT id  x y z  qx qy qz qw
///     VERTEX_TRACKXYZ id  x y z
///     EDGE_SE2 i j  x y theta  I11 I12 I13 I22 I23 I33
///     EDGE_SE2_XY i j  x y  I11 I12 I22
///     EDGE_SE3:QUAT i j  x y z  qx qy qz qw  I11 I12 ... I66
///     EDGE_SE3_TRACKXYZ i j [p]  x y z  I11 I12 I13 I22 I23 I33
///     EDGE_PRIOR_SE2 i  x y theta  I11 I12 I13 I22 I23 I33        (also EDGE_SE2_PRIOR)
///     EDGE_PRIOR_SE2_XY i  x y  I11 I12 I22
///     EDGE_SE3_PRIOR i [p]  x y z  qx qy qz qw  I11 I12 ... I66
///     EDGE_SE3_PRIORXYZ i  x y z  I11 I12 I13 I22 I23 I33
///     PARAMS_SE3OFFSET p  x y z  qx qy qz qw
///     FIX id
///
/// One record a line, '#' begins a comment line. Metres and radians. An edge says how vertex j
/// looks from pose i: the pose j, or the point j, in the frame of pose i. With a parameter p an
/// EDGE_SE3_TRACKXYZ is measured in a sensor frame that stands at the offset p in the frame of pose
/// i; it is moved into the frame of pose i on reading.
///
/// **Priors** are measurements of pose i from the world (graph/world.h): of the pose, or of its
/// position alone, with information along the axes of the world. Any edge may name `world` for its
/// first vertex too, which other programs do not read. The pose of a sensor at an offset p is moved
/// to the pose, its information to first order.
///
/// **Ids** are whole numbers from 0, kept as they are: pose:id, point:id in the session given in
/// the options. An id written `2/17` is 17 of session 2; that is how a file of links between two
/// recordings names the variables of both. What an id stands for follows from the edges; vertices
/// are optional and never used as a guess.
///
/// **Information** is of the residual (R_z^T (t - t_z), rotation vector of R_z^T R), z the
/// measurement and (R, t) what the estimate says: exactly the tangent of the library's poses, so it
/// is taken as it is. Rotation is counted per radian of rotation vector, as GTSAM, Ceres and
/// SE-Sync read these files. g2o itself means the vector part of the quaternion of R_z^T R, which
/// is half the rotation vector to first order: with `quaternion_information` the rows and columns
/// of rotation are halved, J^T I J with J = diag(1, 1/2).

namespace mapjoin {

struct G2oOptions {
  /// Session of ids that are written without one.
  std::uint32_t session = 0;
  /// Count records that mapjoin has no meaning for instead of refusing them.
  bool skip_unknown = false;
  /// 3D information is of the quaternion's vector part, see above.
  bool quaternion_information = false;
  /// Subtracted from the ids of points, for files whose points were renumbered (see
  /// G2oWriteOptions).
  std::uint64_t feature_offset = 0;
  InformationPolicy indefinite = InformationPolicy::kRefuse;
};

/// What was in the file.
struct G2oCounts {
  std::int64_t poses = 0;                     ///< that take part in measurements
  std::int64_t points = 0;                    ///< likewise
  std::map<std::string, std::int64_t> edges;  ///< by tag
  std::map<std::string, std::int64_t>
      skipped;                         ///< by tag: records passed over because of skip_unknown
  std::int64_t isolated_vertices = 0;  ///< vertices without any measurement: not part of the graph
  std::int64_t repaired = 0;           ///< information matrices changed by the policy
};

/// A measurement graph of the plane or of space, as read.
struct G2oGraph {
  int dimension = 0;
  std::variant<MeasurementGraph<2>, MeasurementGraph<3>> graph;
  /// The pose that the file fixes: the frame in which to write results, with that pose at the
  /// identity.
  std::optional<Key> fixed;
  G2oCounts counts;

  /// The graph, when its dimension is known to be D. `const auto graph = read_g2o(file).as<2>();`
  /// moves it out.
  template <int D>
  const MeasurementGraph<D>& as() const& {
    return std::get<MeasurementGraph<D>>(graph);
  }
  template <int D>
  MeasurementGraph<D> as() && {
    return std::get<MeasurementGraph<D>>(std::move(graph));
  }
};

/// One file of several, and the session of its plain ids.
struct G2oSource {
  std::filesystem::path path;
  std::uint32_t session = 0;
};

/// Reads a measurement graph.
///
/// Repeated edges are several measurements. Refused, with file, line and remedy: lines with too few
/// or too many numbers, numbers that are not finite, quaternions of length zero, negative ids, an
/// edge from a vertex to itself, an id that is a pose here and a point there (in edges or
/// vertices), one vertex with two values, 2D and 3D records in one file, several FIX, unknown
/// records, files without any edge. `skip_unknown` lets through what is unknown, and FIX after the
/// first. Indefinite information: by policy. \throws InputError, FileError.
G2oGraph read_g2o(const std::filesystem::path& file, const G2oOptions& options = {});

/// Reads several files into one graph; options.session is not used. Each file may fix a pose: the
/// first is returned.
G2oGraph read_g2o(std::span<const G2oSource> files, const G2oOptions& options = {});

/// Reads the vertices only, as a solution or ground truth. The same errors as above for vertices.
std::variant<Values<2>, Values<3>> read_g2o_values(const std::filesystem::path& file,
                                                   const G2oOptions& options = {});

struct G2oWriteOptions {
  /// Write points with ids 100000 (or the next power of ten above the largest pose id) higher, as
  /// the data sets of this field do. Done in any case when a point and a pose have the same id. The
  /// file says so in a comment line.
  bool feature_offset = false;
  /// Write 3D information for the quaternion's vector part, as g2o means it.
  bool quaternion_information = false;
  /// Written as FIX.
  std::optional<Key> fixed;
  /// Lines of comment at the head of the file, without '#'.
  std::string comment;
};

/// Writes a solution: one vertex a pose and point, numbers with as many digits as reading them back
/// exactly takes.
///
/// Ids of several sessions are written as session * 10^k + id, with the smallest k that keeps them
/// apart, and a comment line that says so. The world is no vertex: a comment line says where it is.
/// The file appears complete or not at all. \throws InputError when a variable is of a type that
/// g2o does not know; FileError.
template <int D>
void write_g2o(const std::filesystem::path& file, const Values<D>& values,
               const G2oWriteOptions& options = {});

/// Writes measurements, and the values of `values` as vertices when it is given.
/// \throws InputError when the graph holds what g2o cannot say: joint information of several
/// variables (a native map can).
template <int D>
void write_g2o(const std::filesystem::path& file, const MeasurementGraph<D>& graph,
               const std::type_identity_t<Values<D>>* values = nullptr,
               const G2oWriteOptions& options = {});

}  // namespace mapjoin
