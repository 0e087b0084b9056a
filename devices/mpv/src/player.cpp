#include "rtpm/device_mpv/player.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace rtpm::device_mpv {
namespace {

constexpr float kNowhere = -1;

float clamped(float value, float low, float high, float otherwise) noexcept {
  return std::isfinite(value) ? std::clamp(value, low, high) : otherwise;
}

float analog(double value, double low, double high) noexcept {
  return std::isfinite(value) ? static_cast<float>(std::clamp(value, low, high)) : 0;
}

}  // namespace

driver::Descriptor player_descriptor(std::string serial, std::string frame) {
  driver::Descriptor descriptor;
  descriptor.device_class = driver::DeviceClass::kPlayer;
  descriptor.model = "mpv media player";
  descriptor.serial = std::move(serial);
  descriptor.frame = std::move(frame);
  descriptor.outputs = {
      {.name = "rate", .unit = "1", .low = -kRateMax, .high = kRateMax, .safe = 0},
      {.name = "seek", .unit = "s", .low = kNowhere, .high = kLengthMaxSeconds, .safe = kNowhere}};
  descriptor.analogs = {{.name = "position", .unit = "s", .low = 0, .high = kLengthMaxSeconds},
                        {.name = "rate", .unit = "1", .low = -kRateMax, .high = kRateMax},
                        {.name = "duration", .unit = "s", .low = 0, .high = kLengthMaxSeconds},
                        {.name = "pause", .unit = "1", .low = 0, .high = 1},
                        {.name = "frame", .unit = "s", .low = 0, .high = 1}};
  descriptor.modes = {driver::CommandMode::kOutputs};
  descriptor.rate_hz = 100;
  return descriptor;
}

PlayerRequest request_of(const driver::Command& command) noexcept {
  PlayerRequest request;
  if (command.mode == driver::CommandMode::kOutputs) {
    request.rate = clamped(command.outputs[0], -kRateMax, kRateMax, 0);
    request.seek_s = clamped(command.outputs[1], kNowhere, kLengthMaxSeconds, kNowhere);
  }
  return request;
}

void fill(driver::Sample& sample, const PlayerState& player,
          const PlayerRequest& request) noexcept {
  const double rate = player.is_backwards ? -player.speed : player.speed;
  sample.analogs[0] = analog(player.position_s, 0, kLengthMaxSeconds);
  sample.analogs[1] = player.is_paused ? 0 : analog(rate, -kRateMax, kRateMax);
  sample.analogs[2] = analog(player.duration_s, 0, kLengthMaxSeconds);
  sample.analogs[3] = player.is_paused ? 1 : 0;
  sample.analogs[4] = analog(player.frame_s, 0, 1);
  sample.outputs_applied = {request.rate, request.seek_s};
}

}  // namespace rtpm::device_mpv
