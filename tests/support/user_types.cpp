#include "tests/support/user_types.h"

namespace mapjoin::test {

constinit const VariableKind<2> kWallKind = mapjoin::detail::make_kind<Wall>();
constinit const VariableKind<2> kBias2Kind = mapjoin::detail::make_kind<BiasType<2>>();
constinit const VariableKind<3> kBias3Kind = mapjoin::detail::make_kind<BiasType<3>>();
constinit const VariableKind<2> kLineKind = mapjoin::detail::make_kind<own::Line>();
constinit const VariableKind<3> kDirectionKind = mapjoin::detail::make_kind<own::Direction>();
constinit const VariableKind<3> kPlaneKind = mapjoin::detail::make_kind<own::Plane>();

}  // namespace mapjoin::test
