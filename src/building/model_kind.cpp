#include "mapjoin/building/model_kind.h"

namespace mapjoin::detail {

constinit const ModelKind<2> kRelativePose2 = make_model<RelativeModel<Pose2>>();
constinit const ModelKind<3> kRelativePose3 = make_model<RelativeModel<Pose3>>();
constinit const ModelKind<2> kRelativePoint2 = make_model<RelativeModel<Point2>>();
constinit const ModelKind<3> kRelativePoint3 = make_model<RelativeModel<Point3>>();
constinit const ModelKind<2> kRangeBearing = make_model<RangeBearing>();
constinit const ModelKind<3> kRangeBearingElevation = make_model<RangeBearingElevation>();
constinit const ModelKind<2> kBearingOnly = make_model<BearingOnly>();
constinit const ModelKind<2> kRangeOnly = make_model<RangeOnly>();
constinit const ModelKind<2> kVelocityTurnRate = make_model<VelocityTurnRate>();

}  // namespace mapjoin::detail
