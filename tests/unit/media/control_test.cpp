#include "control.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "rtpm/device_sim/gaze_driver.hpp"
#include "rtpm/device_sim/knob_driver.hpp"
#include "rtpm/device_sim/player_driver.hpp"
#include "rtpm/models/check.hpp"

namespace rtpm::media {
namespace {

constexpr double kNotch = 2 * std::numbers::pi / Control::kNotchesPerTurn;
constexpr PlayerView kPlayer{.position_s = 4, .duration_s = 20, .frame_s = 0.04, .rate = 0};

Control control_in(Mode mode, double angle_rad = 0) {
  Control control({.joint = 0, .effort_newton_metre_max = 0.05}, 4);
  control.enter(mode, angle_rad, kPlayer);
  return control;
}

TEST(MediaControl, PlaysAQuarterFasterPerDetent) {
  Control control = control_in(Mode::kSpeed, 1);
  EXPECT_EQ(control.step(1).rate, 0);
  EXPECT_EQ(control.step(1 + 4 * kNotch).rate, 1);
  EXPECT_EQ(control.step(1 - 2 * kNotch).rate, -0.5);
  EXPECT_EQ(control.step(1 + 100 * kNotch).rate, 4) << "not beyond the player's";
  EXPECT_LT(control.step(1).seek_s, 0);
}

TEST(MediaControl, StaysInADetentUntilTheNextIsNearer) {
  Control control = control_in(Mode::kSpeed);
  EXPECT_EQ(control.step(0.55 * kNotch).rate, 0);
  EXPECT_EQ(control.step(0.65 * kNotch).rate, 0.25);
  EXPECT_EQ(control.step(0.45 * kNotch).rate, 0.25);
  EXPECT_EQ(control.step(0.35 * kNotch).rate, 0);
}

TEST(MediaControl, ScrubsTenSecondsPerTurnByWholeFrames) {
  Control control = control_in(Mode::kScrub, -2);
  EXPECT_NEAR(control.step(-2).seek_s, 4, 1e-9);
  EXPECT_NEAR(control.step(-2 + std::numbers::pi).seek_s, 9, 0.021);
  EXPECT_NEAR(control.step(-2 - std::numbers::pi / 2).seek_s, 1.5, 0.021);
  EXPECT_EQ(control.step(-2).seek_s, control.step(-2 + 1e-4).seek_s) << "the same frame";
  EXPECT_EQ(control.step(0).rate, 0);
  EXPECT_EQ(control.step(-100).seek_s, 0);
  EXPECT_NEAR(control.step(100).seek_s, 19.96, 1e-9) << "the last frame";
}

TEST(MediaControl, GoesOneFramePerDetent) {
  Control control = control_in(Mode::kFrame);
  EXPECT_NEAR(control.step(3 * kNotch).seek_s, 4.12, 1e-9);
  EXPECT_NEAR(control.step(-1 * kNotch).seek_s, 3.96, 1e-9);
}

TEST(MediaControl, HasFeelsThatTheKnobTakes) {
  const driver::Descriptor knob = device_sim::KnobDriver({}).describe();
  const auto channel = knob_channel("knob", knob);
  ASSERT_TRUE(channel);
  for (const Mode mode : {Mode::kSpeed, Mode::kScrub, Mode::kFrame}) {
    Control control(*channel, 4);
    control.enter(mode, 3, kPlayer);
    const auto models = control.models();
    const auto checked = check(gvd::ModelList(models),
                               gvd::ModelLimits::for_device(knob, std::chrono::milliseconds{1}));
    EXPECT_TRUE(checked) << to_string(mode) << ": " << to_text(checked.error());
  }
}

TEST(MediaChannels, AreThoseOfThePlayer) {
  const auto channels = PlayerChannels::of("player", device_sim::PlayerDriver({}).describe());
  ASSERT_TRUE(channels);
  driver::Sample sample;
  sample.analogs = {7.5F, 2};
  EXPECT_EQ(channels->view(sample).position_s, 7.5);
  EXPECT_EQ(channels->view(sample).rate, 2);
  EXPECT_EQ(channels->view(sample).duration_s, device_sim::PlayerDriver::kLengthSeconds);
  EXPECT_GT(channels->view(sample).frame_s, 0);
  EXPECT_EQ(channels->rate_max(), 4);
  const driver::Setpoint setpoint = channels->setpoint(0.5, -1);
  EXPECT_EQ(setpoint.outputs[0], 0.5F);
  EXPECT_EQ(setpoint.outputs[1], -1.0F);
}

TEST(MediaChannels, RefuseOtherDevices) {
  const driver::Descriptor gaze = device_sim::GazeDriver({}).describe();
  EXPECT_NE(PlayerChannels::of("lab/gaze0", gaze).error().text().find("--player"),
            std::string::npos);
  EXPECT_NE(knob_channel("lab/gaze0", gaze).error().text().find("--knob"), std::string::npos);
}

}  // namespace
}  // namespace rtpm::media
