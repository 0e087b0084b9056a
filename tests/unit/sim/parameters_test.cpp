#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "dialogue.hpp"
#include "rtpm/device_sim/biometric_driver.hpp"
#include "rtpm/device_sim/gaze_driver.hpp"
#include "rtpm/device_sim/knob_driver.hpp"
#include "rtpm/device_sim/player_driver.hpp"
#include "rtpm/device_sim/sim_driver.hpp"
#include "rtpm/device_sim/stimulus_driver.hpp"

/// The parameters of the simulated devices.
namespace rtpm::device_sim {
namespace {

using driver::ParameterSetting;
using test::Cycles;

/// Changes one parameter.
void set(driver::Driver& driver, const std::string& name, driver::ParameterValue value) {
  std::vector<ParameterSetting> settings{{name, std::move(value)}};
  const auto done = driver.set_parameters(settings);
  ASSERT_TRUE(done) << done.error().text();
}

std::vector<std::unique_ptr<driver::Driver>> all() {
  std::vector<std::unique_ptr<driver::Driver>> drivers;
  drivers.push_back(std::move(*SimDriver::create({})));
  drivers.push_back(std::make_unique<GazeDriver>(TwinConfig{}));
  drivers.push_back(std::make_unique<BiometricDriver>(TwinConfig{}));
  drivers.push_back(std::make_unique<KnobDriver>(TwinConfig{}));
  drivers.push_back(std::make_unique<PlayerDriver>(TwinConfig{}));
  drivers.push_back(std::make_unique<StimulusDriver>(TwinConfig{}));
  return drivers;
}

TEST(Parameters, AreDescribedAndAcceptedByEveryDevice) {
  for (const auto& driver : all()) {
    const auto specs = driver->parameters();
    EXPECT_FALSE(specs.empty());
    std::set<std::string> names;
    std::vector<ParameterSetting> defaults;
    for (const driver::ParameterSpec& spec : specs) {
      EXPECT_EQ(fault_of(spec), "") << spec.name;
      EXPECT_FALSE(spec.description.empty()) << spec.name;
      EXPECT_TRUE(names.insert(spec.name).second) << spec.name;
      if (spec.mutability == driver::Mutability::kReadOnly) continue;
      defaults.push_back({spec.name, spec.default_value});
    }
    const auto before = defaults;
    EXPECT_TRUE(driver->set_parameters(defaults));
    EXPECT_EQ(defaults, before);
  }
}

TEST(KnobParameters, SetDetentsThatHoldTheKnob) {
  KnobDriver knob({}, {.hand_newton_metre = 0});
  set(knob, "detent.count", std::int64_t{12});
  Cycles cycles(knob);
  driver::Setpoint push;
  push.mode = driver::CommandMode::kJointEffort;
  push.joints[0] = 0.005;
  const double held_rad = cycles.run(2000, push).joints[0];
  EXPECT_LT(held_rad, 2 * 3.14159 / 12 / 2) << "half the detent's torque";
  EXPECT_GT(held_rad, 0.01);
  EXPECT_NEAR(cycles.run(4000).joints[0], 0, 2e-3) << "and pulls it back";
  set(knob, "detent.torque_newton_metre", 0.002);
  EXPECT_GT(cycles.run(2000, push).joints[0], 1) << "a weak one does not";
}

TEST(BiometricParameters, SetPulseGainAndHeartRate) {
  BiometricDriver sensor({});
  const auto beat_count = [&] {
    Cycles cycles(sensor);
    int count = 0;
    bool was_high = false;
    for (int i = 0; i < 10'000; ++i) {
      const bool is_high = cycles.run(1).analogs[0] > 0.7F;
      if (is_high && !was_high) ++count;
      was_high = is_high;
    }
    return count;
  };
  EXPECT_EQ(beat_count(), 11);
  set(sensor, "person.heart_rate_hz", 2.0);
  EXPECT_EQ(beat_count(), 20);
  set(sensor, "pulse.gain", 0.5);
  EXPECT_EQ(beat_count(), 0) << "too weak to be seen";
}

TEST(PlayerParameters, SetLoopAndRateLimit) {
  PlayerDriver player({});
  set(player, "loop", true);
  set(player, "rate_max", 2.0);
  Cycles cycles(player);
  cycles.run(1, driver::Setpoint::with_outputs({2, 59}));
  const driver::Sample& sample = cycles.run(1000, driver::Setpoint::with_outputs({4, -1}));
  EXPECT_NEAR(sample.analogs[0], 1, 0.01) << "59 s + 2 s in a second";
  EXPECT_EQ(sample.analogs[1], 2);
}

}  // namespace
}  // namespace rtpm::device_sim
