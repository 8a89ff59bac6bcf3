// Filters and comparisons, as a user runs them.

#include <filesystem>
#include <nlohmann/json.hpp>

#include "mapjoin/io/local_maps.h"
#include "tests/program/workbench.h"
#include "tests/support/local_map_chain.h"
#include "tests/support/wandering.h"

namespace mapjoin::test {
namespace {

using ::testing::HasSubstr;

class Filters : public Workbench {
 protected:
  /// A folder of local maps of a small walk.
  std::string local_maps() const {
    LocalMapSet<2> set;
    set.pose_feature = true;
    auto chain = random_chain<2>(1, {.maps = 10, .features = 60, .noise = 0.02});
    for (LocalMap<2>& map : chain.maps) {
      for (Key& key : map.keys) ++key.id;  // the format has no id 0
      for (Key& key : map.anchor.keys) ++key.id;
      set.maps.push_back(std::move(map));
    }
    write_local_maps(file("maps"), set);
    return file("maps");
  }
  /// The same of a walk among points that can be told apart.
  std::string local_maps_to_associate() const {
    Dice dice(4);
    LocalMapSet<2> set;
    set.pose_feature = true;
    set.maps = wander<2>(dice, {.maps = 8}).maps;
    write_local_maps(file("walk"), set);
    return file("walk");
  }
  static nlohmann::json read_json(const std::string& path) {
    std::ifstream in(path);
    return nlohmann::json::parse(in);
  }
};

TEST_F(Filters, JoinLocalMapsByEveryMethod) {
  const std::string maps = local_maps();
  run({"join", maps, "--output", file("optimum.g2o")});
  for (const std::string method : {"slsjf", "islsjf", "dslam", "idslam", "ekf"}) {
    const std::string out = run({"join", maps, "--method", method, "--output",
                                 file(method + ".g2o"), "--json", file(method + ".json")});
    EXPECT_THAT(out, HasSubstr("method        " + method));
    EXPECT_THAT(out, HasSubstr("10 maps fused"));
    EXPECT_EQ(read_json(file(method + ".json"))["method"], method);
    const std::string judged =
        run({"evaluate", file(method + ".g2o"), "--reference", file("optimum.g2o")});
    EXPECT_LT(figure(judged, "aligned_feature_rmse"), 0.05) << method;
  }
  const std::string judged =
      run({"evaluate", file("islsjf.g2o"), "--maps", maps, "--reference", file("optimum.g2o")});
  EXPECT_LT(figure(judged, "pose_rmse"), 1e-4);
}

TEST_F(Filters, WriteMapsThatCanBeUsedFurther) {
  const std::string maps = local_maps();
  run({"join", maps, "--method", "slsjf", "--output", file("a.map")});
  run({"marginalize", file("a.map"), "--keep", "features", "--output", file("features.map")});
  run({"join", maps, "--method", "ekf", "--output", file("b.map"), "--anchor", "pose:1"});
  run({"covariance", file("b.map"), "--all", "--output", file("b.csv")});
}

/// What `mapjoin build` makes of one recording: as text, and as native maps alone.
TEST_F(Filters, TakeNativeLocalMapsAsTheyTakeText) {
  run({"simulate", "beacons", "--poses", "400", "--output", file("field")});
  run({"build", file("field"), "--segment", "maps:8", "--builder", "ekf", "--keep", "end-pose",
       "--output", file("text")});
  std::filesystem::create_directory(file("native"));
  for (const auto& entry : std::filesystem::directory_iterator(file("text"))) {
    if (entry.path().extension() == ".map")
      std::filesystem::copy(entry.path(), file("native") + "/" + entry.path().filename().string());
  }
  for (const std::string method : {"slsjf", "islsjf", "dslam", "idslam", "ekf"}) {
    for (const std::string kind : {"text", "native"}) {
      run({"join", file(kind), "--method", method, "--output", file(kind + ".map")});
    }
    const std::string judged =
        run({"evaluate", file("native.map"), "--reference", file("text.map")});
    EXPECT_LT(figure(judged, "aligned_feature_rmse"), 1e-6) << method;
  }
  EXPECT_THAT(run({"compare", file("native"), "--methods", "slsjf,dslam"}), HasSubstr("dslam"));
}

TEST_F(Filters, SayWhatANativeMapLacks) {
  run({"simulate", "beacons", "--poses", "400", "--output", file("field")});
  run({"build", file("field"), "--segment", "maps:4", "--keep", "features", "--output",
       file("features")});
  for (const auto& entry : std::filesystem::directory_iterator(file("features"))) {
    if (entry.path().extension() != ".map") std::filesystem::remove(entry.path());
  }
  expect_refused({"join", file("features"), "--method", "ekf", "--output", file("x.map")},
                 "in the frame of the pose they begin at");
}

/// The features are found first; any method goes on from the numbers that were found.
TEST_F(Filters, GoOnFromFeaturesThatWereFound) {
  const std::string maps = local_maps_to_associate();
  for (const std::string method : {"slsjf", "islsjf", "dslam", "idslam", "ekf"}) {
    const std::string out = run({"join", maps, "--method", method, "--associate", "jcbb", "--judge",
                                 "--output", file("found.map")});
    EXPECT_THAT(out, HasSubstr("precision 1.00000")) << method;
    EXPECT_THAT(out, HasSubstr("maps fused")) << method;
  }
}

TEST_F(Filters, AreComparedWhileFeaturesAreFound) {
  const std::string maps = local_maps_to_associate();
  for (const std::string matcher : {"nn", "gnn", "jcbb"}) {
    const std::string out = run({"compare", maps, "--methods", "slsjf,ekf,dslam", "--associate",
                                 matcher, "--json", file("table.json")});
    EXPECT_THAT(out, HasSubstr("precision"));
    const nlohmann::json table = read_json(file("table.json"));
    for (const std::size_t k : {0U, 1U}) {
      EXPECT_EQ(table[k]["right_matches"], table[k]["matches"]) << matcher;
      EXPECT_GT(table[k]["right_matches"], 0.8 * table[k]["seen_before"].get<double>()) << matcher;
      EXPECT_GT(table[k]["seconds_by_step"]["associate"], 0.0);
    }
    EXPECT_THAT(table[2]["failure"].get<std::string>(), HasSubstr("--associate"));
  }
}

TEST_F(Filters, RefuseWhatGoesWithTheLinearMethod) {
  const std::string maps = local_maps();
  expect_refused({"join", maps, "--method", "slsjf", "--mode", "paper", "--output", file("x.g2o")},
                 "--mode goes with --method linear");
  expect_refused({"join", maps, "--method", "ekf", "--features-only", "--output", file("x.g2o")},
                 "--features-only goes with --method linear");
  expect_refused({"join", maps, "--method", "kalman", "--output", file("x.g2o")}, "--method");
  run({"join", maps, "--output", file("a.map")});
  expect_refused({"join", file("a.map"), "--method", "slsjf", "--output", file("x.g2o")},
                 "goes with a folder of local maps");
  expect_refused(
      {"join", maps, "--method", "dslam", "--anchor", "pose:5", "--output", file("x.g2o")},
      "pose:5");
}

TEST_F(Filters, AreComparedInOneTable) {
  const std::string maps = local_maps();
  const std::string out = run({"compare", maps, "--json", file("table.json")});
  for (const char* method :
       {"linear:paper", "linear:optimal", "slsjf", "islsjf", "dslam", "idslam", "ekf"}) {
    EXPECT_THAT(out, HasSubstr(method));
  }
  const nlohmann::json table = read_json(file("table.json"));
  ASSERT_EQ(table.size(), 9U);
  double optimum = 0.0;
  for (const auto& row : table) {
    EXPECT_FALSE(row.contains("failure")) << row;
    EXPECT_GT(row["seconds"], 0.0);
    if (row["method"] == "linear:optimal") optimum = row["chi2"];
  }
  for (const auto& row : table) {
    if (row["method"] == "islsjf") {
      EXPECT_NEAR(row["chi2"], optimum, 1e-6 * optimum);
    } else if (row["method"] == "slsjf") {
      EXPECT_EQ(row["seconds_per_map"].size(), 10U);
    }
  }
}

TEST_F(Filters, AreComparedWithAReferenceAndTheTruth) {
  const std::string maps = local_maps();
  run({"join", maps, "--output", file("reference.g2o")});
  const auto chain = random_chain<2>(1, {.maps = 10, .features = 60, .noise = 0.02});
  std::string csv = "id,x,y\n";
  for (const Key& key : keys_of(chain.truth)) {
    if (key.type != Tag("point")) continue;
    const Vec<2> p = chain.truth.point(key);
    csv +=
        std::to_string(key.id + 1) + "," + std::to_string(p(0)) + "," + std::to_string(p(1)) + "\n";
  }
  const std::string out =
      run({"compare", maps, "--methods", "slsjf,ekf,linear", "--reference", file("reference.g2o"),
           "--truth", write("truth.csv", csv), "--json", file("table.json")});
  EXPECT_THAT(out, HasSubstr("NEES"));
  for (const auto& row : read_json(file("table.json"))) {
    EXPECT_GT(row["nees"], 0.0);
    EXPECT_LT(row["feature_rmse"], 0.1);
  }
}

TEST_F(Filters, AreComparedOnOneRecordingWithEkfSlam) {
  run({"simulate", "beacons", "--poses", "300", "--output", file("field")});
  const std::string truth = file("field") + "/beacons_true.csv";
  const std::string out =
      run({"compare", file("field"), "--segment", "maps:12", "--builder", "ekf", "--methods",
           "slsjf,slsjf:anew:4,ekf,ekf-slam", "--truth", truth, "--json", file("table.json"),
           "--output", file("found"), "--watch", "point:1,point:2"});
  EXPECT_THAT(out, HasSubstr("local maps    12"));
  const nlohmann::json table = read_json(file("table.json"));
  ASSERT_EQ(table.size(), 4U);
  for (const auto& row : table) {
    const std::string method = row["method"];
    const bool whole_run = method == "ekf-slam";
    EXPECT_FALSE(row.contains("failure")) << row;
    EXPECT_EQ(row[whole_run ? "seconds_per_pose" : "seconds_per_map"].size(), whole_run ? 300 : 12);
    EXPECT_LE(row["within_2_sigma"], 1.0);
    ASSERT_EQ(row["watched"].size(), 2U);
    for (const auto& [point, sights] : row["watched"].items()) {
      EXPECT_EQ(sights.back()[0], 299) << "known until the last pose: " << point;
      EXPECT_LE(sights.back()[3], sights.front()[3]) << "a bound shrinks: " << row;
    }
  }
  // The same features in all; only the filters over local maps keep every end pose.
  const double features = figure(run({"info", file("found") + "/ekf.map"}), "variables");
  for (const std::string method : {"slsjf", "slsjf_anew_4", "ekf", "ekf-slam"}) {
    const std::string map = run({"info", file("found") + "/" + method + ".map"});
    EXPECT_EQ(figure(map, "variables"), features) << "points come first";
    EXPECT_THAT(map, HasSubstr(method.starts_with("slsjf") ? "13 pose" : "2 pose"));
  }
}

TEST_F(Filters, EkfSlamWantsARecording) {
  const std::string maps = local_maps();
  expect_refused({"compare", maps, "--methods", "ekf-slam"}, "ekf-slam filters a recording");
  expect_refused({"compare", maps, "--builder", "ekf"}, "--segment");
  expect_refused({"compare", maps, "--methods", "slsjf:anew:often"}, "slsjf:anew:50");
  run({"simulate", "landmarks2d", "--poses", "40", "--output", file("world.g2o")});
  expect_refused({"compare", file("world.g2o")}, "--segment");
  expect_refused({"compare", file("world.g2o"), "--segment", "often"}, "often");
}

TEST_F(Filters, AreNotComparedOnNothing) {
  const std::string maps = local_maps();
  expect_refused({"compare", maps, "--methods", "slsjf,best"}, "there is no method 'best'");
  expect_refused({"compare", file("nowhere")}, "nowhere");
  expect_refused({"compare", maps, "--truth", file("nowhere.csv")}, "nowhere.csv");
}

TEST_F(Filters, SayInTheirRowWhatTheyCannotJoin) {
  LocalMapSet<2> set;
  set.pose_feature = true;
  auto chain = random_chain<2>(1, {.maps = 6, .features = 60, .noise = 0.02});
  for (std::size_t k = 0; k < chain.maps.size(); ++k) {
    LocalMap<2> map = chain.maps[k];
    for (Key& key : map.keys) ++key.id;
    for (Key& key : map.anchor.keys) ++key.id;
    if (k == 3) map.anchor.keys[0].id = 100;  // begins at a pose that nothing else knows
    set.maps.push_back(std::move(map));
  }
  write_local_maps(file("maps"), set);
  const std::string out = run({"compare", file("maps"), "--methods", "ekf,slsjf"});
  EXPECT_THAT(out, HasSubstr("pose:100 does not begin where the one before it ends"));
}

}  // namespace
}  // namespace mapjoin::test
