#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "rtpm/device_sim/biometric_driver.hpp"
#include "rtpm/device_sim/gaze_driver.hpp"
#include "rtpm/device_sim/knob_driver.hpp"
#include "rtpm/device_sim/player_driver.hpp"
#include "rtpm/device_sim/sim_driver.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"

/// I/O transparency: the same client code uses different devices, by their descriptions alone.
namespace rtpm::gvd {
namespace {

using namespace std::chrono_literals;
using driver::CommandMode;

/// The client code's findings about a device.
struct Findings {
  std::size_t channel_count = 0;  ///< The channels whose values it has read.
  bool moves_by_itself = false;   ///< A value changed between two samples.
  std::vector<CommandMode> obeyed{};
  DeviceOutcome refusal = DeviceOutcome::kDone;  ///< The refusal of an unsupported mode.
};

/// A tenth of the device's range, in `mode`.
driver::Setpoint gentle(const driver::Descriptor& device, CommandMode mode) {
  driver::Setpoint setpoint;
  setpoint.mode = mode;
  setpoint.wrench.force_newton.x = device.limits.force_newton_max / 10;
  for (std::size_t i = 0; i < device.joints.size(); ++i)
    setpoint.joints[i] = device.joints[i].effort_max / 10;
  for (std::size_t i = 0; i < device.outputs.size(); ++i)
    setpoint.outputs[i] = static_cast<float>(device.outputs[i].high / 10);
  return setpoint;
}

bool is_obeyed(const driver::Descriptor& device, const driver::Sample& sample, CommandMode mode) {
  switch (mode) {
    case CommandMode::kForce:
      return sample.wrench_applied.force_newton.x > 0;
    case CommandMode::kJointEffort:
      return std::ranges::any_of(sample.efforts_applied, [](double effort) { return effort > 0; });
    case CommandMode::kOutputs:
      return sample.outputs_applied[0] == static_cast<float>(device.outputs[0].high / 10);
    default:
      return false;
  }
}

std::vector<double> values_of(const driver::Descriptor& device, const driver::Sample& sample) {
  std::vector<double> values;
  if (!device.axes.empty()) {
    values.insert(values.end(), {sample.pose.position_m.x, sample.pose.orientation.x});
  }
  for (std::size_t i = 0; i < device.joints.size(); ++i)
    values.push_back(sample.joints[i]);
  for (std::size_t i = 0; i < device.analogs.size(); ++i)
    values.push_back(static_cast<double>(sample.analogs[i]));
  return values;
}

/// Commands in `mode` until the device obeys.
bool obeys(DeviceClient& device, CommandMode mode) {
  const MonotonicTime give_up = rt::now() + 5s;
  while (rt::now() < give_up) {
    const auto set = device.set(gentle(device.descriptor(), mode));
    if (!set) return false;
    const auto sample = device.read();
    if (sample && is_obeyed(device.descriptor(), *sample, mode)) return true;
    std::this_thread::sleep_for(1ms);
  }
  return false;
}

/// The client code: it names no device.
Findings use(DeviceClient& device) {
  Findings findings;
  const driver::Descriptor& description = device.descriptor();
  EXPECT_TRUE(device.acquire());
  const auto first = device.read();
  EXPECT_TRUE(first);
  for (const CommandMode mode : description.modes) {
    if (obeys(device, mode)) findings.obeyed.push_back(mode);
  }
  driver::Setpoint pose;
  pose.mode = CommandMode::kPose;
  const auto refused = device.set(pose);
  if (!refused) findings.refusal = refused.error().outcome();
  const auto before = values_of(description, *first);
  findings.channel_count = before.size();
  const MonotonicTime give_up = rt::now() + 5s;
  while (!findings.moves_by_itself && rt::now() < give_up) {
    const auto sample = device.read();
    findings.moves_by_itself = sample && values_of(description, *sample) != before;
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_TRUE(device.release());
  return findings;
}

class Transparency : public ::testing::Test {
 protected:
  void host(const std::string& name, std::unique_ptr<driver::Driver> driver) {
    DeviceServerConfig config;
    config.thread.realtime = rt::RealtimeMode::kOff;
    auto device = DeviceServer::create(std::move(driver), std::move(config));
    ASSERT_TRUE(device) << device.error().text();
    ASSERT_TRUE(server_->add(name, (*device)->servant()));
    ASSERT_TRUE((*device)->start());
    devices_.emplace(name, std::move(*device));
  }
  Findings use_device(const std::string& name) {
    auto client = DeviceClient::open(node_, server_->url(name));
    RTPM_ASSERT(client.has_value(), "opens");
    return use(*client);
  }

  std::unique_ptr<rpc::Server> server_ =
      rpc::Server::create({.realtime = rt::RealtimeMode::kOff}).value();
  std::map<std::string, std::unique_ptr<DeviceServer>> devices_{};
  rpc::Node node_{};
};

TEST_F(Transparency, OnePieceOfCodeDrivesUnlikeDevices) {
  auto arm = device_sim::SimDriver::create({});
  ASSERT_TRUE(arm);
  host("arm", std::move(*arm));
  host("gaze", std::make_unique<device_sim::GazeDriver>(device_sim::TwinConfig{}));
  host("biometric", std::make_unique<device_sim::BiometricDriver>(device_sim::TwinConfig{}));
  host("knob", std::make_unique<device_sim::KnobDriver>(device_sim::TwinConfig{}));
  host("player", std::make_unique<device_sim::PlayerDriver>(device_sim::TwinConfig{}));
  ASSERT_TRUE(server_->start());
  const std::map<std::string, std::vector<CommandMode>> obeyed{
      {"arm", {CommandMode::kForce}},
      {"gaze", {}},
      {"biometric", {}},
      {"knob", {CommandMode::kJointEffort}},
      {"player", {CommandMode::kOutputs}}};
  for (const auto& [name, modes] : obeyed) {
    const Findings findings = use_device(name);
    EXPECT_EQ(findings.obeyed, modes) << name;
    EXPECT_EQ(findings.refusal, DeviceOutcome::kWrongMode) << name;
    EXPECT_GT(findings.channel_count, 0u) << name;
    EXPECT_TRUE(findings.moves_by_itself) << name;
  }
}

}  // namespace
}  // namespace rtpm::gvd
