#include "rtpm/device_sim/stimulus_driver.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "settings.hpp"

namespace rtpm::device_sim {
namespace {

constexpr std::array kStimuli{"flash", "beep", "tap"};

std::string delay_of(const char* stimulus) {
  return std::string(stimulus) + ".delay_s";
}

}  // namespace

driver::Descriptor StimulusDriver::describe() const {
  driver::Descriptor descriptor =
      identity(driver::DeviceClass::kInput, "RTPM simulated stimulus board");
  for (const char* stimulus : kStimuli)
    descriptor.outputs.push_back({.name = stimulus, .unit = "1", .low = 0, .high = 1, .safe = 0});
  descriptor.analogs = {{.name = "photodiode", .unit = "1", .low = 0, .high = 1},
                        {.name = "microphone", .unit = "1", .low = 0, .high = 1}};
  descriptor.buttons = {"key"};
  descriptor.modes = {driver::CommandMode::kOutputs};
  descriptor.rate_hz = 1000;
  return descriptor;
}

std::vector<driver::ParameterSpec> StimulusDriver::parameters() const {
  std::vector<driver::ParameterSpec> specs;
  for (std::size_t i = 0; i < kCount; ++i) {
    specs.push_back({.name = delay_of(kStimuli[i]),
                     .unit = "s",
                     .low = 0,
                     .high = 0.2,
                     .default_value = channels_[i].delay_s,
                     .description = "How long after the output its sensor follows."});
  }
  return specs;
}

expected<void, SetupError> StimulusDriver::set_parameters(
    std::span<driver::ParameterSetting> settings) {
  for (std::size_t i = 0; i < kCount; ++i)
    take(settings, delay_of(kStimuli[i]), channels_[i].delay_s);
  return {};
}

void StimulusDriver::reset() noexcept {
  for (Channel& channel : channels_)
    channel = {.delay_s = channel.delay_s};
}

void StimulusDriver::step(const driver::Command& command, double, driver::Sample& sample) noexcept {
  const bool is_commanded = command.mode == driver::CommandMode::kOutputs;
  for (std::size_t i = 0; i < kCount; ++i) {
    Channel& channel = channels_[i];
    const float wanted = is_commanded && std::isfinite(command.outputs[i])
                             ? std::clamp(command.outputs[i], 0.0F, 1.0F)
                             : 0.0F;
    if (wanted != channel.output) {
      channel.output = wanted;
      channel.changed_s = time_s();
    }
    if (time_s() - channel.changed_s >= channel.delay_s) channel.sensed = channel.output;
    sample.outputs_applied[i] = channel.output;
  }
  sample.analogs[0] = channels_[0].sensed;
  sample.analogs[1] = channels_[1].sensed;
  set_button(sample, channels_[2].sensed > 0.5F);
}

}  // namespace rtpm::device_sim
