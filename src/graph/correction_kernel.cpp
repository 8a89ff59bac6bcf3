#include "mapjoin/graph/correction_kernel.h"

namespace mapjoin {

template double relative_correction<PoseType<2>>(const RelativeBatch<2>&, double*);
template double relative_correction<PoseType<3>>(const RelativeBatch<3>&, double*);
template double relative_correction<PointType<2>>(const RelativeBatch<2>&, double*);
template double relative_correction<PointType<3>>(const RelativeBatch<3>&, double*);

}  // namespace mapjoin
