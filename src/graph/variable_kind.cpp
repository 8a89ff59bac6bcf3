#include "mapjoin/graph/variable_kind.h"

namespace mapjoin::detail {

constinit const VariableKind<2> kPose2 = make_kind<Pose2>();
constinit const VariableKind<2> kPoint2 = make_kind<Point2>();
constinit const VariableKind<3> kPose3 = make_kind<Pose3>();
constinit const VariableKind<3> kPoint3 = make_kind<Point3>();

}  // namespace mapjoin::detail
