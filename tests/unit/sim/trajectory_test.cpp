#include "rtpm/device_sim/trajectory.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <sstream>
#include <string>

namespace rtpm::device_sim {
namespace {

constexpr driver::Workspace kWorkspace{{-0.1, -0.1, -0.1}, {0.1, 0.1, 0.1}};

expected<Trajectory, SetupError> parse(const std::string& text) {
  std::istringstream stream(text);
  return Trajectory::parse(stream, "hand.csv", kWorkspace);
}

std::string error_of(const std::string& text) {
  const auto result = parse(text);
  return result ? "no error" : result.error().reason();
}

TEST(Trajectory, ReadsWithAndWithoutHeaderCommentsAndSpaces) {
  for (const char* text :
       {"t_s,x_m,y_m,z_m\n0,0,0,0\n1,0.01,0.02,0.03\n", "0,0,0,0\n1,0.01,0.02,0.03",
        "\xef\xbb\xbf# by hand\r\n t_s , x_m,y_m , z_m\r\n\r\n 0, 0 ,0,0\r\n"
        "1,+0.01,2e-2,.03\r\n"}) {
    const auto trajectory = parse(text);
    ASSERT_TRUE(trajectory) << trajectory.error().text();
    EXPECT_EQ(trajectory->point_count(), 2u);
    EXPECT_DOUBLE_EQ(trajectory->duration_s(), 1);
    EXPECT_TRUE(trajectory->at(1).position_m.isApprox(Eigen::Vector3d(0.01, 0.02, 0.03)));
  }
}

TEST(Trajectory, InterpolatesLinearlyBetweenPoints) {
  // Times begin at the recorder's start, and the steps differ.
  const auto trajectory = parse("100,0,0,0\n100.1,0.01,0,0\n102.1,0.01,0.04,0\n");
  ASSERT_TRUE(trajectory);
  EXPECT_TRUE(trajectory->at(0.05).position_m.isApprox(Eigen::Vector3d(0.005, 0, 0)));
  EXPECT_NEAR(trajectory->at(0.05).velocity_m_per_s.x(), 0.1, 1e-9);
  EXPECT_TRUE(trajectory->at(1.1).position_m.isApprox(Eigen::Vector3d(0.01, 0.02, 0)));
  EXPECT_NEAR(trajectory->at(1.1).velocity_m_per_s.y(), 0.02, 1e-9);
}

TEST(Trajectory, PlaysForthAndBackWithoutAJump) {
  const auto trajectory = parse("0,0,0,0\n1,0.02,0,0\n2,0.02,0.03,0\n");
  ASSERT_TRUE(trajectory);
  Eigen::Vector3d last = trajectory->at(0).position_m;
  for (int ms = 1; ms < 9000; ++ms) {
    const Motion motion = trajectory->at(ms * 0.001);
    EXPECT_LE((motion.position_m - last).norm(), 0.03 * 0.001 + 1e-12) << "at " << ms << " ms";
    last = motion.position_m;
  }
  EXPECT_TRUE(trajectory->at(3).position_m.isApprox(trajectory->at(1).position_m));
  EXPECT_NEAR(trajectory->at(3.5).velocity_m_per_s.x(), -0.02, 1e-9) << "backwards";
  EXPECT_TRUE(trajectory->at(4.5).position_m.isApprox(trajectory->at(0.5).position_m));
}

TEST(Trajectory, StandsStillAtASinglePoint) {
  const auto trajectory = parse("5,0.01,0,0\n");
  ASSERT_TRUE(trajectory);
  EXPECT_EQ(trajectory->at(0).position_m.x(), 0.01);
  EXPECT_EQ(trajectory->at(77).position_m.x(), 0.01);
  EXPECT_EQ(trajectory->at(77).velocity_m_per_s.norm(), 0);
}

TEST(Trajectory, ToleratesAbsurdTimes) {
  const auto trajectory = parse("0,0,0,0\n1,0.02,0,0\n");
  ASSERT_TRUE(trajectory);
  for (const double time_s : {-1.0, 1e300, std::nan(""), HUGE_VAL}) {
    const Motion motion = trajectory->at(time_s);
    EXPECT_TRUE(motion.position_m.allFinite());
    EXPECT_GE(motion.position_m.x(), 0);
    EXPECT_LE(motion.position_m.x(), 0.02);
  }
}

TEST(TrajectoryErrors, NameFileLineAndFault) {
  const std::string no_number = "which is not a number (a decimal point, no unit)";
  const std::string four = "expected four numbers separated by commas, t_s,x_m,y_m,z_m, and found ";
  const std::string no_points = "no points; give lines of t_s,x_m,y_m,z_m";
  for (const auto& [text, error] : std::vector<std::pair<std::string, std::string>>{
           {"", "1: " + no_points},
           {"t_s,x_m,y_m,z_m\n\n", "2: " + no_points},
           {"0,0,0,0\n1,0,0\n", "2: " + four + "fewer"},
           {"0,0,0,0,0\n", "1: " + four + "more"},
           {"0,0,0,0\n1,0,up,0\n", "2: y_m is \"up\", " + no_number},
           {"0,0,0,0\n1,0,,0\n", "2: y_m is \"\", " + no_number},
           {"0,0,0,nan\n", "1: z_m is \"nan\"; it must be finite"},
           {"inf,0,0,0\n", "1: t_s is \"inf\"; it must be finite"},
           {"1e999,0,0,0\n", "1: t_s is \"1e999\", beyond the range of numbers"},
           {"0,0,0,0\n0.5,0,0,0\n0.5,0,0,0\n",
            "3: t_s is 0.5 after 0.5; times must grow from line to line"},
           {"0,0,0,0\n1,35,0,0\n",
            "2: x_m is 35, outside the arm's workspace of -0.1 to 0.1 m; positions are in metres"},
           // Only the first line may be a header.
           {"0,0,0,0\nt_s,x_m,y_m,z_m\n", "2: t_s is \"t_s\", " + no_number}}) {
    EXPECT_EQ(error_of(text), "hand.csv:" + error);
  }
}

TEST(TrajectoryErrors, AreShortForLongLines) {
  const std::string error = error_of(std::string(100000, 'x') + ",0,0,0\n");
  EXPECT_LT(error.size(), 200u);
  EXPECT_TRUE(error.starts_with("hand.csv:1: t_s is \"xxx")) << error;
}

TEST(TrajectoryErrors, NameAMissingFile) {
  const auto missing = Trajectory::load("no/such/hand.csv", kWorkspace);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().text(),
            "no/such/hand.csv can't be read. Remedy: check that the file is there and readable.");
  const auto folder = Trajectory::load(::testing::TempDir(), kWorkspace);
  ASSERT_FALSE(folder);
  EXPECT_NE(folder.error().text().find("is a folder"), std::string::npos);
}

}  // namespace
}  // namespace rtpm::device_sim
