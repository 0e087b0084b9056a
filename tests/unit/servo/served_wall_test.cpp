#include "served_wall.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace rtpm::servo {
namespace {

using driver::ParameterSetting;
using gvd::ConfigurationOutcome;

driver::Descriptor haptic_device() {
  driver::Descriptor device;
  device.device_class = driver::DeviceClass::kHaptic;
  device.rate_hz = 1000;
  device.limits = {
      .force_newton_max = 9, .stiffness_newton_per_m_max = 1666, .damping_newton_s_per_m = 2.5};
  for (const char* axis : {"x", "y", "z"})
    device.axes.push_back({axis, true, true});
  return device;
}

class WallParametersTest : public testing::Test {
 protected:
  [[nodiscard]] expected<void, gvd::ConfigurationError> apply(
      std::vector<ParameterSetting> settings) {
    return parameters_.apply(settings, false);
  }

  bool is_taken_ = true;
  std::vector<Wall> walls_{};
  WallParameters parameters_{{.device = "lab/arm0"},
                             haptic_device(),
                             {.stiffness_newton_per_m = 600, .damping_newton_s_per_m = 0.5},
                             [this](const Wall& wall) {
                               walls_.push_back(wall);
                               return is_taken_;
                             }};
};

TEST_F(WallParametersTest, AreDescribedWithinWhatTheDeviceAllows) {
  const auto specs = parameters_.parameters();
  ASSERT_EQ(specs.size(), 2U);
  EXPECT_EQ(specs[0].name, "wall.stiffness_newton_per_m");
  EXPECT_EQ(std::get<double>(specs[0].default_value), 600);
  EXPECT_DOUBLE_EQ(specs[0].high, 1000);  // 2.5 N s/m / (0.5 ms + 2 * 1 ms).
  EXPECT_EQ(specs[1].name, "wall.damping_newton_s_per_m");
  EXPECT_EQ(specs[1].high, 2.5);
  for (const auto& spec : specs) {
    EXPECT_EQ(driver::fault_of(spec), "") << spec.name;
    EXPECT_EQ(spec.mutability, driver::Mutability::kAnyTime);
  }
}

TEST_F(WallParametersTest, ChangeOneValueAndKeepTheOther) {
  ASSERT_TRUE(apply({{"wall.stiffness_newton_per_m", 300.0}}));
  ASSERT_TRUE(apply({{"wall.damping_newton_s_per_m", 1.0}}));
  ASSERT_EQ(walls_.size(), 2U);
  EXPECT_EQ(walls_[1].stiffness_newton_per_m, 300);
  EXPECT_EQ(walls_[1].damping_newton_s_per_m, 1);
}

TEST_F(WallParametersTest, RefuseAWallThatWouldBuzzWithItsDamping) {
  const auto refused = apply({{"wall.stiffness_newton_per_m", 950.0}});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().outcome, ConfigurationOutcome::kRefusedByDevice);
  EXPECT_NE(refused.error().words.text().find("800"), std::string::npos);
  EXPECT_TRUE(walls_.empty());
  // Without damping the same wall is passive: damping and stiffness are judged together.
  EXPECT_TRUE(
      apply({{"wall.stiffness_newton_per_m", 950.0}, {"wall.damping_newton_s_per_m", 0.0}}));
}

TEST_F(WallParametersTest, AreUnchangedWhenTheLoopDoesNotTakeThem) {
  is_taken_ = false;
  EXPECT_EQ(apply({{"wall.stiffness_newton_per_m", 300.0}}).error().outcome,
            ConfigurationOutcome::kBusy);
  is_taken_ = true;
  ASSERT_TRUE(apply({{"wall.damping_newton_s_per_m", 0.0}}));
  EXPECT_EQ(walls_.back().stiffness_newton_per_m, 600);
}

}  // namespace
}  // namespace rtpm::servo
