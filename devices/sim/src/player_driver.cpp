#include "rtpm/device_sim/player_driver.hpp"

#include <algorithm>
#include <cmath>

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

void PlayerDriver::reset() noexcept {
  position_s_ = 0;
  last_seek_s_ = kNowhere;
}

void PlayerDriver::step(const driver::Command& command, double elapsed_s,
                        driver::Sample& sample) noexcept {
  const bool is_commanded = command.mode == driver::CommandMode::kOutputs;
  float rate = is_commanded ? clamped(command.outputs[0], -kRateMax, kRateMax, 0) : 0;
  const float seek_s =
      is_commanded ? clamped(command.outputs[1], kNowhere, kLengthSeconds, kNowhere) : kNowhere;
  if (seek_s >= 0 && seek_s != last_seek_s_) position_s_ = seek_s;
  last_seek_s_ = seek_s;
  const double next_s = position_s_ + elapsed_s * rate;
  position_s_ = std::clamp(next_s, 0.0, kLengthSeconds);
  if (position_s_ != next_s) rate = 0;
  sample.analogs[0] = static_cast<float>(position_s_);
  sample.analogs[1] = rate;
  sample.outputs_applied = {rate, seek_s};
}

}  // namespace rtpm::device_sim
