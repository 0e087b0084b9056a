#include "rtpm/device_sim/sim_driver.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <string>
#include <vector>

namespace rtpm::device_sim {
namespace {

using std::chrono::milliseconds;

/// Runs `cycle_count` cycles of 1 ms with a wall at z = 0 and returns all samples.
std::vector<driver::Sample> run(SimDriver& sim, int cycle_count, double stiffness_newton_per_m) {
  EXPECT_TRUE(sim.configure({.period = milliseconds{1}}));
  EXPECT_TRUE(sim.activate());
  std::vector<driver::Sample> samples;
  driver::Sample sample;
  for (int i = 1; i <= cycle_count; ++i) {
    driver::Command command;
    command.cycle_time = MonotonicTime{milliseconds{i}};
    const double depth_m = -sample.pose.position_m.z;
    if (depth_m > 0) {
      command.mode = driver::CommandMode::kForce;
      command.wrench.force_newton.z = stiffness_newton_per_m * depth_m;
    }
    sample.faults = {};
    EXPECT_EQ(sim.exchange(command, sample), driver::ExchangeStatus::kOk);
    samples.push_back(sample);
  }
  sim.deactivate();
  return samples;
}

std::unique_ptr<SimDriver> make(SimConfig config = {}) {
  auto sim = SimDriver::create(std::move(config));
  EXPECT_TRUE(sim) << sim.error().text();
  return std::move(*sim);
}

TEST(SimDriver, PressesIntoAWallAndIsHeldByIt) {
  auto sim = make();
  double deepest_free_m = 0;
  for (const auto& sample : run(*sim, 4000, 0)) {
    deepest_free_m = std::max(deepest_free_m, -sample.pose.position_m.z);
  }
  double deepest_m = 0;
  double greatest_newton = 0;
  for (const auto& sample : run(*sim, 4000, 600)) {
    deepest_m = std::max(deepest_m, -sample.pose.position_m.z);
    greatest_newton = std::max(greatest_newton, sample.wrench_applied.force_newton.z);
  }
  EXPECT_NEAR(deepest_free_m, 0.015, 0.002) << "without a wall the arm goes where the hand does";
  EXPECT_NEAR(deepest_m, 0.005, 0.001) << "hand and wall in balance: 15 mm · 300 / (300 + 600)";
  EXPECT_NEAR(greatest_newton, 600 * deepest_m, 0.1);
}

TEST(SimDriver, GivesIdenticalSamplesForIdenticalCommands) {
  auto one = make({.seed = 5});
  auto same = make({.seed = 5});
  auto other = make({.seed = 6});
  const auto samples = run(*one, 500, 600);
  const auto again = run(*one, 500, 600);
  const auto twin = run(*same, 500, 600);
  const auto stranger = run(*other, 500, 600);
  bool differs = false;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    ASSERT_EQ(samples[i].pose.position_m, twin[i].pose.position_m);
    ASSERT_EQ(samples[i].pose.position_m, again[i].pose.position_m) << "activation starts anew";
    ASSERT_EQ(samples[i].twist.linear_m_per_s, twin[i].twist.linear_m_per_s);
    differs = differs || samples[i].pose.position_m != stranger[i].pose.position_m;
  }
  EXPECT_TRUE(differs) << "another seed is another tremor";
}

TEST(SimDriver, CountsButtonEdges) {
  auto sim = make();
  std::uint32_t buttons = 0;
  std::uint16_t edge_count = 0;
  const auto samples = run(*sim, 4100, 0);
  for (const auto& sample : samples) {
    if (sample.buttons != buttons) ++edge_count;
    buttons = sample.buttons;
    ASSERT_EQ(sample.button_edges[0], edge_count);
  }
  EXPECT_EQ(edge_count, 5) << "pressed at 0, 2 and 4 s, released after 0.2 s";
}

TEST(SimDriver, FollowsARecordedHand) {
  const std::string path = ::testing::TempDir() + "/rtpm_sim_driver_test.csv";
  std::ofstream(path) << "t_s,x_m,y_m,z_m\n0,0.03,0,0.02\n2,0.03,0,-0.02\n";
  auto sim = make({.hand_file = path});
  const auto samples = run(*sim, 2000, 0);
  EXPECT_NEAR(samples.front().pose.position_m.x, 0.03, 1e-4);
  EXPECT_NEAR(samples[999].pose.position_m.z, 0, 0.001);
  EXPECT_NEAR(samples[1999].pose.position_m.z, -0.02, 0.001);
  EXPECT_NEAR(samples[999].twist.linear_m_per_s.z, -0.02, 0.005);
}

TEST(SimDriver, RefusesInvalidSettings) {
  SimConfig config;
  config.arm.mass_kg = 0;
  const auto weightless = SimDriver::create(config);
  ASSERT_FALSE(weightless);
  EXPECT_EQ(weightless.error().text(), "the simulated arm's mass_kg is no number above zero.");
}

TEST(SimDriver, StaysStillWithoutAHand) {
  auto sim = make({.is_held = false});
  for (const auto& sample : run(*sim, 100, 0)) {
    ASSERT_EQ(sample.pose.position_m, driver::Vector3{}) << "nothing moves it";
  }
}

TEST(SimDriver, IsGoneWhileItIsNotActive) {
  auto sim = make();
  driver::Sample sample;
  EXPECT_EQ(sim->exchange({}, sample), driver::ExchangeStatus::kGone);
}

TEST(SimDriver, PublishesAStiffnessWithinItsDamping) {
  const driver::Descriptor descriptor = make()->describe();
  EXPECT_EQ(descriptor.limits.force_newton_max, 9);
  // b > K · (T / 2 + T): 2.5 N·s/m at 1 kHz.
  EXPECT_NEAR(descriptor.limits.stiffness_newton_per_m_max, 1666.7, 0.1);
}

}  // namespace
}  // namespace rtpm::device_sim
