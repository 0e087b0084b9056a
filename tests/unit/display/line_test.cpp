#include "line.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "rtpm/device_sim/biometric_driver.hpp"
#include "rtpm/device_sim/gaze_driver.hpp"
#include "rtpm/device_sim/knob_driver.hpp"
#include "rtpm/device_sim/player_driver.hpp"
#include "rtpm/device_sim/sim_driver.hpp"

/// One line format suits every device: the description determines its contents.
namespace rtpm::display {
namespace {

TEST(Line, ShowsPositionAndForceOfAnArm) {
  const auto arm = device_sim::SimDriver::create({});
  ASSERT_TRUE(arm);
  driver::Sample sample;
  sample.pose.position_m = {0.0212, -0.001, 0.0004};
  sample.wrench_applied.force_newton = {0, 3, 4};
  EXPECT_EQ(values_text((*arm)->describe(), sample).substr(0, 46),
            "at  +21.2   -1.0   +0.4 mm  force  5.00 N");
  EXPECT_EQ(first_value((*arm)->describe(), sample), 5);
}

TEST(Line, ShowsTheGazePointOfATracker) {
  driver::Sample sample;
  // 10 degrees to the left: a turn about y.
  sample.pose.orientation = {0, std::sin(0.0873), 0, std::cos(0.0873)};
  sample.buttons = 1;
  const std::string line = values_text(device_sim::GazeDriver({}).describe(), sample);
  EXPECT_EQ(line.substr(0, line.find("pupil")), "looks 10.0° left   0.0° up    ");
  EXPECT_NE(line.find("[blink]"), std::string::npos);
}

TEST(Line, ShowsTheChannelsOfOtherDevicesWithUnits) {
  driver::Sample sample;
  sample.joints[0] = 1;
  EXPECT_EQ(values_text(device_sim::KnobDriver({}).describe(), sample), "dial   +57.3°");
  sample.analogs = {0.5F, 1.25F, 5.5e-6F};
  EXPECT_EQ(values_text(device_sim::BiometricDriver({}).describe(), sample),
            "pulse 0.50  heart_rate  1.25 Hz  skin_conductance  5.50 µS");
}

TEST(Line, ShowsForeignTextEscaped) {
  driver::Descriptor descriptor;
  descriptor.analogs = {{.name = "a\033[2J", .unit = "1"}};
  EXPECT_EQ(values_text(descriptor, {}).find('\033'), std::string::npos);
}

TEST(Curve, RunsFromTheLeastToTheGreatest) {
  const std::array<double, 4> values{-1, 0, 3, 1};
  EXPECT_EQ(curve_text(values), "▁▃█▅");
  const std::array<double, 2> same{2, 2};
  EXPECT_EQ(curve_text(same), "▁▁");
  EXPECT_EQ(curve_text({}), "");
}

TEST(Text, IsFittedByColumns) {
  EXPECT_EQ(fitted("10°", 5), "10°  ");
  EXPECT_EQ(fitted("▁▂▃", 2), "▁▂");
  EXPECT_EQ(width_of("▁▂° a"), 5u);
}

}  // namespace
}  // namespace rtpm::display
