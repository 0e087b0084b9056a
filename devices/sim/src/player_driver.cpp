#include "rtpm/device_sim/player_driver.hpp"

#include <algorithm>
#include <cmath>

#include "settings.hpp"

namespace rtpm::device_sim {
namespace {

constexpr float kRateMax = 4;
constexpr float kNowhere = -1;

float clamped(float value, float low, float high, float otherwise) noexcept {
  return std::isfinite(value) ? std::clamp(value, low, high) : otherwise;
}

}  // namespace

driver::Descriptor PlayerDriver::describe() const {
  driver::Descriptor descriptor =
      identity(driver::DeviceClass::kPlayer, "RTPM simulated media player");
  descriptor.outputs = {
      {.name = "rate", .unit = "1", .low = -kRateMax, .high = kRateMax, .safe = 0},
      {.name = "seek", .unit = "s", .low = kNowhere, .high = kLengthSeconds, .safe = kNowhere}};
  descriptor.analogs = {{.name = "position", .unit = "s", .low = 0, .high = kLengthSeconds},
                        {.name = "rate", .unit = "1", .low = -kRateMax, .high = kRateMax}};
  descriptor.modes = {driver::CommandMode::kOutputs};
  descriptor.rate_hz = 100;
  return descriptor;
}

std::vector<driver::ParameterSpec> PlayerDriver::parameters() const {
  return {{.name = "loop",
           .type = driver::ParameterType::kBool,
           .default_value = false,
           .description = "Plays on at the other end."},
          {.name = "rate_max",
           .unit = "1",
           .low = 0.1,
           .high = kRateMax,
           .default_value = double{kRateMax},
           .description = "Greatest rate, forwards and backwards."}};
}

expected<void, SetupError> PlayerDriver::set_parameters(
    std::span<driver::ParameterSetting> settings) {
  take(settings, "loop", is_looping_);
  take(settings, "rate_max", rate_max_);
  return {};
}

void PlayerDriver::reset() noexcept {
  position_s_ = 0;
  last_seek_s_ = kNowhere;
}

void PlayerDriver::step(const driver::Command& command, double elapsed_s,
                        driver::Sample& sample) noexcept {
  const bool is_commanded = command.mode == driver::CommandMode::kOutputs;
  const auto rate_max = static_cast<float>(rate_max_);
  float rate = is_commanded ? clamped(command.outputs[0], -rate_max, rate_max, 0) : 0;
  const float seek_s =
      is_commanded ? clamped(command.outputs[1], kNowhere, kLengthSeconds, kNowhere) : kNowhere;
  if (seek_s >= 0 && seek_s != last_seek_s_) position_s_ = seek_s;
  last_seek_s_ = seek_s;
  double next_s = position_s_ + elapsed_s * rate;
  if (is_looping_) next_s -= kLengthSeconds * std::floor(next_s / kLengthSeconds);
  position_s_ = std::clamp(next_s, 0.0, kLengthSeconds);
  if (position_s_ != next_s) rate = 0;
  sample.analogs[0] = static_cast<float>(position_s_);
  sample.analogs[1] = rate;
  sample.outputs_applied = {rate, seek_s};
}

}  // namespace rtpm::device_sim
