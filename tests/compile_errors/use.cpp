// What a user does with a type of their own; MISTAKEN is examples/line2.h with one mistake in it.
#include "mapjoin/graph/measurement_graph.h"
#include "mapjoin/graph/values.h"
#include MISTAKEN

#ifdef USE_VALUES
double use(const mapjoin::Values<2>& values) { return values.at<own::Line>(own::line_key(1)).a; }
#else
void use(mapjoin::MeasurementGraphBuilder<2>& builder) {
  builder.add<own::Line>(mapjoin::pose_key(0), own::line_key(1), {0.5, 2.0},
                         mapjoin::Mat<2, 2>::Identity());
}
#endif
