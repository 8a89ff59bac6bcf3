// mapjoin build, and what is done with what it writes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/program/workbench.h"

namespace mapjoin::test {
namespace {

using ::testing::HasSubstr;

class Build : public Workbench {
 protected:
  static int files(const std::string& folder, const std::string& ending) {
    int count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      count += entry.path().extension() == ending ? 1 : 0;
    return count;
  }
};

TEST_F(Build, LocalMapsAreBuiltAndJoined) {
  const std::string world = simulate("landmarks2d", 120);
  run({"solve", world, "--output", file("optimum.g2o")});
  for (const std::string builder : {"nls", "ekf"}) {
    for (const std::string anchor : {"start", "end", "features"}) {
      const std::string maps = file("maps_" + builder + anchor);
      EXPECT_THAT(run({"build", world, "--segment", "poses:20", "--builder", builder, "--anchor",
                       anchor, "--output", maps}),
                  HasSubstr("local maps    6"));
      EXPECT_EQ(files(maps, ".map"), 6);
      run({"join", maps, "--mode", "observe", "--output", file("joined.g2o")});
      const std::string figures =
          run({"evaluate", file("joined.g2o"), "--reference", file("optimum.g2o")});
      EXPECT_LT(figure(figures, "pose_rmse"), 0.05) << builder << " " << anchor;
    }
  }
}

TEST_F(Build, WritesTextTooWhereThatCanSayIt) {
  const std::string world = simulate("landmarks2d", 60);
  run({"build", world, "--segment", "poses:20", "--output", file("maps")});
  EXPECT_EQ(files(file("maps"), ".txt"), 3);
  std::filesystem::create_directory(file("text"));
  for (int k = 1; k <= 3; ++k) {
    const std::string name = "/localmap_" + std::to_string(k) + ".txt";
    std::filesystem::rename(file("maps") + name, file("text") + name);
  }
  run({"join", file("maps"), "--output", file("a.g2o")});
  run({"join", file("text"), "--output", file("b.g2o")});
  const std::string figures = run({"evaluate", file("a.g2o"), "--reference", file("b.g2o")});
  EXPECT_LT(figure(figures, "pose_rmse"), 1e-4);
  EXPECT_THAT(run({"build", world, "--segment", "poses:20", "--anchor", "features", "--output",
                   file("framed")}),
              HasSubstr("no localmap_K.txt"));
  EXPECT_EQ(files(file("framed"), ".txt"), 0);
}

TEST_F(Build, TheOptimumIsTheSameForAnyNumberOfLocalMaps) {
  const std::string world = simulate("manhattan", 150);
  run({"solve", world, "--output", file("optimum.g2o")});
  for (const std::string n : {"1", "4", "30"}) {
    const std::string out =
        run({"solve", world, "--local-maps", n, "--output", file("by_maps.g2o")});
    EXPECT_THAT(out, HasSubstr(n + " local maps, built in"));
    const std::string figures =
        run({"evaluate", file("by_maps.g2o"), "--reference", file("optimum.g2o")});
    EXPECT_LT(figure(figures, "pose_rmse"), 5e-5) << n;
  }
}

TEST_F(Build, ALogOfBeaconsBecomesAMapNearTheTruth) {
  run({"simulate", "beacons", "--poses", "400", "--output", file("field")});
  run({"build", file("field"), "--segment", "poses:40", "--builder", "ekf", "--keep", "end-pose",
       "--output", file("maps")});
  run({"join", file("maps"), "--output", file("field.map")});
  const std::string figures =
      run({"evaluate", file("field.map"), "--truth", file("field/beacons_true.csv")});
  EXPECT_LT(figure(figures, "nees"), 1.5 * figure(figures, "dimension"));
  EXPECT_GT(figure(figures, "nees"), 0.5 * figure(figures, "dimension"));
}

/// Near a beacon noise makes ranges of 0 and less.
TEST_F(Build, WhatIsTooNearIsLeftOutWhenAskedAndCounted) {
  write("log/controls.csv", "speed_mps,turnrate_radps\n1,0\n1,0\n");
  write("log/observations.csv",
        "step,beacon,range_m,bearing_rad\n1,7,2.0,0.5\n2,7,1.8,0.6\n2,8,-0.1,2.0\n3,8,0.4,1.0\n");
  const std::vector<std::string> build = {"build",    file("log"), "--segment",
                                          "poses:10", "--output",  file("maps")};
  expect_refused(build, "--nearest");
  std::vector<std::string> nearest = build;
  nearest.insert(nearest.end(), {"--nearest", "0.5"});
  const std::string out = run(nearest);
  EXPECT_THAT(out, HasSubstr("2 observations nearer than 0.5 m were left out"));
  EXPECT_THAT(out, HasSubstr("measurements  4 used, 0 refused"));
}

TEST_F(Build, FramesOfFeaturesNeedFeatures) {
  const std::string world = simulate("manhattan", 60);
  expect_refused(
      {"build", world, "--segment", "poses:20", "--anchor", "features", "--output", file("maps")},
      "no features");
  expect_refused({"solve", world, "--local-maps", "3", "--local-anchor", "features", "--output",
                  file("out.g2o")},
                 "no features");
}

TEST_F(Build, MapsOfFeaturesJoin) {
  const std::string world = simulate("landmarks2d", 120);
  run({"build", world, "--segment", "features:15", "--keep", "features", "--output", file("maps")});
  run({"join", file("maps"), "--output", file("features.map")});
}

TEST_F(Build, RefusesAndLeavesNothingBehind) {
  const std::string world = simulate("landmarks2d", 40);
  const std::string out = file("maps");
  expect_refused({"build", world, "--segment", "sometimes", "--output", out}, "poses:N");
  expect_refused({"build", world, "--segment", "poses:5", "--robust", "tukey", "--output", out},
                 "geman-mcclure");
  expect_refused({"build", world, "--segment", "poses:5", "--builder", "ekf", "--robust", "huber",
                  "--output", out},
                 "nonlinear builder");
  expect_refused({"build", file("nowhere.g2o"), "--segment", "poses:5", "--output", out},
                 "no file");
  const std::string poses = write("poses.g2o", "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n");
  expect_refused({"build", poses, "--segment", "poses:5", "--keep", "features", "--output", out},
                 "build larger local maps");
  write("full/file", "x");
  expect_refused({"build", world, "--segment", "poses:5", "--output", file("full")},
                 "new or empty");
  write("log/controls.csv", "speed_mps,turnrate_radps\n1,x\n");
  write("log/observations.csv", "step,beacon,range_m,bearing_rad\n");
  expect_refused({"build", file("log"), "--segment", "poses:5", "--output", out}, "controls.csv:2");
}

}  // namespace
}  // namespace mapjoin::test
