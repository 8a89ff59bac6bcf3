#include "mapjoin/graph/relative_kernel.h"

namespace mapjoin {

template struct RelativeKernel<PoseType<2>>;
template struct RelativeKernel<PoseType<3>>;
template struct RelativeKernel<PointType<2>>;
template struct RelativeKernel<PointType<3>>;

}  // namespace mapjoin
