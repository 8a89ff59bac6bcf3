// Data association as users run it.
#include "mapjoin/io/local_maps.h"
#include "tests/program/workbench.h"
#include "tests/support/matlab.h"
#include "tests/support/wandering.h"

namespace mapjoin::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class Association : public Workbench {
 protected:
  /// A folder of local maps with their true numbers; of a walk on which no point is an outlier.
  std::string folder(int maps = 8) const {
    Dice dice(4);
    Walk walk;
    walk.maps = maps;
    LocalMapSet<2> set;
    set.maps = wander<2>(dice, walk).maps;
    set.pose_feature = true;
    write_local_maps(file("maps"), set);
    return file("maps");
  }
  std::string content(const std::string& name) const {
    std::ifstream stream(file(name));
    return {std::istreambuf_iterator<char>(stream), {}};
  }
};

TEST_F(Association, FindsWhatTheNumbersSay) {
  const std::string maps = folder();
  run({"join", maps, "--output", file("given.g2o"), "--json", file("given.json")});
  for (const std::string matcher : {"nn", "gnn", "jcbb"}) {
    const std::string said = run({"join", maps, "--associate", matcher, "--judge", "--output",
                                  file("out.g2o"), "--json", file("out.json")});
    EXPECT_THAT(said, HasSubstr("association   " + matcher));
    EXPECT_THAT(said, HasSubstr("precision 1.00000, recall 1.00000"));
    EXPECT_THAT(content("out.json"), HasSubstr("\"matcher\": \"" + matcher + "\""));
    EXPECT_THAT(content("out.json"), HasSubstr("\"precision\": 1.0"));
    const auto chi2 = [&](const std::string& name) {
      const std::string text = content(name);
      return std::stod(text.substr(text.find("\"chi2\": ") + 8));
    };
    EXPECT_NEAR(chi2("out.json"), chi2("given.json"), 1e-6 * chi2("given.json"));
  }
}

TEST_F(Association, GoesWithEveryModeAndStrategy) {
  const std::string maps = folder();
  for (const std::string mode : {"optimal", "observe", "summary", "paper"}) {
    for (const std::string strategy : {"dc", "sequential"}) {
      EXPECT_THAT(run({"join", maps, "--associate", "jcbb", "--judge", "--mode", mode, "--strategy",
                       strategy, "--output", file("out.map")}),
                  HasSubstr("recall 1.00000"));
    }
  }
}

TEST_F(Association, TestsGivenNumbers) {
  const std::string maps = folder();
  EXPECT_THAT(run({"join", maps, "--check-matches", "--output", file("out.g2o")}),
              HasSubstr("given, 0 do not agree with the others"));
  EXPECT_THAT(run({"join", maps, "--output", file("out.g2o")}), Not(HasSubstr("agree")));
}

TEST_F(Association, RefusesWhatMakesNoSense) {
  const std::string maps = folder(3);
  expect_refused({"join", maps, "--judge", "--output", file("out.g2o")}, "--judge goes with");
  expect_refused(
      {"join", maps, "--associate", "jcbb", "--gate", "1.5", "--output", file("out.g2o")},
      "a probability between 0 and 1");
  expect_refused({"join", maps, "--associate", "best", "--output", file("out.g2o")}, "--associate");
  expect_refused({"join", maps, "--associate", "nn", "--odds", "-1", "--output", file("out.g2o")},
                 "--odds");
}

TEST_F(Association, PutsTwoSessionsTogether) {
  Dice dice(8);
  const std::vector<LocalMap<2>> all = wander<2>(dice, {}).maps;
  const auto make = [&](std::size_t first, std::size_t last, const std::string& name,
                        const std::string& session) {
    LocalMapSet<2> set;
    set.maps.assign(all.begin() + static_cast<std::ptrdiff_t>(first),
                    all.begin() + static_cast<std::ptrdiff_t>(last));
    set.pose_feature = true;
    write_local_maps(file(name), set);
    run({"join", file(name), "--session", session, "--output", file(name + ".map")});
  };
  make(0, 8, "monday", "1");
  make(4, 12, "tuesday", "2");
  const std::vector<std::string> both{"join", file("monday.map"), file("tuesday.map")};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), both.begin(), both.end());
    return more;
  };
  EXPECT_THAT(run(with({"--output", file("apart.map")})), HasSubstr("components    2"));
  const std::string said = run(with({"--associate", "jcbb", "--output", file("week.map")}));
  EXPECT_THAT(said, HasSubstr("components    1"));
  EXPECT_THAT(said, HasSubstr("association   jcbb"));
}

TEST_F(Association, TakesMatlabFiles) {
  const auto state = [](const std::vector<int>& ids) {
    Eigen::MatrixXd out(static_cast<Eigen::Index>(ids.size()), 2);
    for (std::size_t k = 0; k < ids.size(); ++k)
      out.row(static_cast<Eigen::Index>(k)) << ids[k], 0.5 * static_cast<double>(k);
    return out;
  };
  const auto content = [&](const std::vector<int>& ids) {
    const auto n = static_cast<Eigen::Index>(ids.size());
    return matlab_file(
        {{"localmap_st", state(ids)}, {"localmap_P", Eigen::MatrixXd::Identity(n, n)}});
  };
  write("mat/localmap_1.mat", content({0, 0, 0, 7, 7}));
  write("mat/localmap_2.mat", content({0, 0, 0, 7, 7}));
  const ProgramRun tried = run_program({"info", file("mat")});
  if (tried.err.find("built without matio") != std::string::npos) GTEST_SKIP() << tried.err;
  EXPECT_THAT(run({"info", file("mat")}), HasSubstr("2D set of 2 local maps, poses and features"));
  EXPECT_THAT(run({"join", file("mat"), "--output", file("out.g2o")}),
              HasSubstr("3 poses, 1 features"));
  write("mat/localmap_2.mat", content({0, 0, 0, 7, 7}).substr(0, 300));
  expect_refused({"join", file("mat"), "--output", file("bad.g2o")}, "localmap_2.mat");
}

}  // namespace
}  // namespace mapjoin::test
