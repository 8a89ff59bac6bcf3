#include "mapjoin/io/tum.h"

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "mapjoin/graph/error.h"
#include "mapjoin/graph/world.h"
#include "mapjoin/io/atomic_file.h"
#include "mapjoin/io/g2o_records.h"
#include "mapjoin/io/plain_ids.h"
#include "mapjoin/io/pose_text.h"
#include "mapjoin/io/read_file.h"
#include "mapjoin/io/text_scanner.h"

namespace mapjoin {

namespace {

Rigid3 lifted(const Rigid3& pose) { return pose; }
Rigid3 lifted(const Rigid2& pose) {
  Rigid3 out;
  out.R.topLeftCorner<2, 2>() = pose.R;
  out.t << pose.t, 0.0;
  return out;
}

Rigid2 flattened(const TextScanner& scan, const Rigid3& pose) {
  constexpr double kTolerance = 1e-6;
  if (std::abs(pose.t(2)) > kTolerance ||
      pose.R(2, 2) < 1.0 - 0.5 * kTolerance * kTolerance - 1e-15) {
    scan.fail("this pose does not lie in the plane z = 0", "read the trajectory in 3D");
  }
  return rigid2(pose.t(0), pose.t(1), std::atan2(pose.R(1, 0), pose.R(0, 0)));
}

Key timestamp_key(TextScanner& scan, std::uint32_t session) {
  const double timestamp = scan.number("the timestamp");
  if (timestamp < 0.0 || timestamp > 9e15 || timestamp != std::floor(timestamp)) {
    scan.fail("the timestamp is not the id of a pose",
              "timestamps have to be whole numbers from 0 here");
  }
  return pose_key(static_cast<std::uint64_t>(timestamp), session);
}

}  // namespace

template <int D>
void write_tum(const std::filesystem::path& file, const Values<D>& values) {
  const int column = values.variables().find_column(Tag("pose"));
  if (column < 0)
    throw InputError(
        "there is no pose to write as a trajectory; write a native map or g2o instead");
  const VariableSet<D> poses({values.variables().column(column)});
  const VariableSet<D>* const sets[] = {&poses};
  const PlainIds<D> ids(sets, false, "TUM");
  std::string out = "# timestamp tx ty tz qx qy qz qw, timestamp = pose id\n";
  for (const std::string& note : ids.notes()) out += "# " + note + "\n";
  const auto all = values.template column<PoseType<D>>();
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (poses.column(0).keys[k] == world_key()) continue;
    out += fmt::format("{}", ids(poses.column(0).keys[k]));
    detail::append_pose<3>(out, lifted(all[k]));
    out += '\n';
  }
  write_atomically(file, out);
}

template <int D>
Values<D> read_tum(const std::filesystem::path& file, std::uint32_t session) {
  const std::string text = read_file(file);
  TextScanner scan(file.string(), text);
  ValuesBuilder<D> builder;
  std::int64_t count = 0;
  for (; scan.next_line(); ++count) {
    scan.expect("timestamp tx ty tz qx qy qz qw");
    const Key key = timestamp_key(scan, session);
    const Rigid3 pose = detail::read_g2o_pose<3>(scan);
    scan.expect_end_of_line("the pose");
    if constexpr (D == 2) {
      builder.template add<Pose2>(key, flattened(scan, pose));
    } else {
      builder.template add<Pose3>(key, pose);
    }
  }
  if (count == 0) throw InputError(fmt::format("{}: there is no pose in this file", file.string()));
  try {
    return std::move(builder).build();
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}", file.string(), error.what()));
  }
}

template void write_tum<2>(const std::filesystem::path&, const Values<2>&);
template void write_tum<3>(const std::filesystem::path&, const Values<3>&);
template Values<2> read_tum<2>(const std::filesystem::path&, std::uint32_t);
template Values<3> read_tum<3>(const std::filesystem::path&, std::uint32_t);

}  // namespace mapjoin
