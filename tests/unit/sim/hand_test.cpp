#include "rtpm/device_sim/hand.hpp"

#include <gtest/gtest.h>

#include <sstream>

namespace rtpm::device_sim {
namespace {

TEST(PressingPath, PressesThroughThePlaneRepeatedly) {
  const PressingPath path{1};
  int press_count = 0;
  bool was_below = false;
  for (int ms = 0; ms < 10000; ++ms) {
    const bool is_below = path.at(ms * 0.001).position_m.z() < -0.002;
    if (is_below && !was_below) ++press_count;
    // The two levels have a margin between them, so that tremor does not count as a press.
    if (is_below || path.at(ms * 0.001).position_m.z() > 0.002) was_below = is_below;
  }
  EXPECT_EQ(press_count, 5) << "one every two seconds";
  EXPECT_GT(path.at(0).position_m.z(), 0.02) << "it begins away from the plane";
}

TEST(PressingPath, HasTheVelocityOfItsPosition) {
  const PressingPath path{7};
  constexpr double kStepSeconds = 1e-6;
  for (double time_s = 0.01; time_s < 3; time_s += 0.037) {
    const Eigen::Vector3d slope =
        (path.at(time_s + kStepSeconds).position_m - path.at(time_s - kStepSeconds).position_m) /
        (2 * kStepSeconds);
    EXPECT_LT((slope - path.at(time_s).velocity_m_per_s).norm(), 1e-6) << "at " << time_s << " s";
  }
}

TEST(PressingPath, DependsOnSeedAndTimeOnly) {
  const PressingPath one{42};
  const PressingPath same{42};
  const PressingPath other{43};
  EXPECT_EQ(one.at(1.234).position_m, same.at(1.234).position_m);
  EXPECT_NE(one.at(1.234).position_m, other.at(1.234).position_m);
  EXPECT_LT((one.at(1.234).position_m - other.at(1.234).position_m).norm(), 0.001)
      << "seeds differ in the tremor only";
}

TEST(PressingPath, StaysInTheDefaultWorkspace) {
  const PressingPath path{3};
  for (int step = 0; step < 20000; ++step) {
    EXPECT_LT(path.at(step * 0.01).position_m.cwiseAbs().maxCoeff(), 0.09);
  }
}

TEST(Hand, FollowsItsRecordingWithoutTheButton) {
  std::istringstream text("0,0.01,0,0\n1,0.02,0,0\n");
  auto recording = Trajectory::parse(text, "hand.csv", {{-1, -1, -1}, {1, 1, 1}});
  ASSERT_TRUE(recording);
  const Hand hand{HandConfig{}, std::move(*recording)};
  EXPECT_NEAR(hand.target_at(0.5).position_m.x(), 0.015, 1e-12);
  EXPECT_FALSE(hand.is_pressing_at(0.1));
  EXPECT_TRUE((Hand{HandConfig{}, PressingPath{1}}.is_pressing_at(0.1)));
}

}  // namespace
}  // namespace rtpm::device_sim
