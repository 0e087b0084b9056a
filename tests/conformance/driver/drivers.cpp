#include "drivers.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <utility>

#include "lever_driver.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/device_mpv/mpv_driver.hpp"
#include "rtpm/device_sim/biometric_driver.hpp"
#include "rtpm/device_sim/gaze_driver.hpp"
#include "rtpm/device_sim/knob_driver.hpp"
#include "rtpm/device_sim/player_driver.hpp"
#include "rtpm/device_sim/sim_driver.hpp"
#include "rtpm/device_sim/stimulus_driver.hpp"
#include "scripted_player.hpp"

namespace rtpm::test {
namespace {

std::unique_ptr<driver::Driver> make_sim(device_sim::SimConfig config) {
  auto sim = device_sim::SimDriver::create(std::move(config));
  RTPM_ASSERT(sim.has_value(), "the simulated arm could not be made");
  return std::move(*sim);
}

/// A recording for the running test alone, since tests run at the same time.
std::string recorded_hand() {
  std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
  std::replace(name.begin(), name.end(), '/', '_');
  std::string path = testing::TempDir() + "driver_conformance_" + name + ".csv";
  std::ofstream(path) << "t_s,x_m,y_m,z_m\n0,0,0,0.02\n0.5,0.01,0,-0.01\n1.5,0,0.02,0.02\n";
  return path;
}

/// The drivers in this file; another file adds one whose library may be missing.
std::vector<DriverUnderTest>& drivers() {
  static std::vector<DriverUnderTest> drivers{
      {"SimHeld", [] { return make_sim({}); }},
      {"SimFree", [] { return make_sim({.is_held = false}); }},
      {"SimRecorded", [] { return make_sim({.hand_file = recorded_hand()}); }},
      {"Gaze", [] { return std::make_unique<device_sim::GazeDriver>(device_sim::TwinConfig{}); }},
      {"Biometric",
       [] { return std::make_unique<device_sim::BiometricDriver>(device_sim::TwinConfig{}); }},
      {"Knob", [] { return std::make_unique<device_sim::KnobDriver>(device_sim::TwinConfig{}); }},
      {"Player",
       [] { return std::make_unique<device_sim::PlayerDriver>(device_sim::TwinConfig{}); }},
      {"Stimulus",
       [] { return std::make_unique<device_sim::StimulusDriver>(device_sim::TwinConfig{}); }},
      {"Mpv",
       [] {
         return std::make_unique<device_mpv::MpvDriver>(
             [] { return std::make_unique<ScriptedPlayer>(); }, "scripted-1", "player/base");
       }},
      {"Template", [] { return std::make_unique<lab::LeverDriver>(); }},
  };
  return drivers;
}

}  // namespace

std::vector<DriverUnderTest> drivers_under_test() {
  return drivers();
}

bool add_driver(DriverUnderTest driver) {
  drivers().push_back(std::move(driver));
  return true;
}

}  // namespace rtpm::test
