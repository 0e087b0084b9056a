#include "rtpm/device_mpv/mpv_driver.hpp"

#include <algorithm>
#include <cmath>
#include <system_error>
#include <utility>

namespace rtpm::device_mpv {
namespace {

constexpr float kNowhere = -1;

float clamped(float value, float low, float high, float otherwise) noexcept {
  return std::isfinite(value) ? std::clamp(value, low, high) : otherwise;
}

/// Within the descriptor's range, whatever the player says.
float analog(double value, double low, double high) noexcept {
  return static_cast<float>(std::clamp(value, low, high));
}

}  // namespace

MpvDriver::MpvDriver(OpenTransport open, std::string serial, std::string frame)
    : open_(std::move(open)), serial_(std::move(serial)), frame_(std::move(frame)) {}

MpvDriver::~MpvDriver() {
  MpvDriver::deactivate();
}

driver::Descriptor MpvDriver::describe() const {
  driver::Descriptor descriptor;
  descriptor.device_class = driver::DeviceClass::kPlayer;
  descriptor.model = "mpv media player";
  descriptor.serial = serial_;
  descriptor.frame = frame_;
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

expected<void, SetupError> MpvDriver::configure(const driver::DriverConfig& config) {
  if (config.period <= Duration{0}) {
    return setup_error("mpv's driver needs a period above zero", "", "set --rate");
  }
  deactivate();
  auto transport = open_();
  if (!transport) return unexpected{transport.error()};
  transport_ = std::move(*transport);
  period_ = config.period;
  session_.emplace(*transport_, period_);
  if (!await_report()) {
    session_.reset();
    transport_.reset();
    return setup_error("mpv does not answer", "", "run mpv on the same file by hand and see why");
  }
  return {};
}

/// Without a command, so that the player is as it was.
bool MpvDriver::await_report() {
  const auto wait = [this](Duration longest, auto is_done) {
    const MonotonicTime end = transport_->now() + longest;
    while (!is_done() && transport_->now() < end) {
      if (!session_->step(std::nullopt, std::chrono::milliseconds{10})) return false;
    }
    return true;
  };
  const PlayerState& player = session_->state();
  return wait(kStartMax, [&] { return player.report_count > 0; }) && player.report_count > 0 &&
         wait(kLoadMax, [&] { return player.duration_s > 0; });
}

expected<void, SetupError> MpvDriver::activate() {
  if (!session_ || is_active_) return setup_error("mpv's driver is not configured");
  seen_corrupt_count_ = session_->corrupt_count();
  requests_.write({});
  report(false);
  is_stopping_.store(false, std::memory_order_relaxed);
  try {
    thread_ = std::thread([this] { run(); });
  } catch (const std::system_error& error) {
    return setup_error("mpv's driver gets no thread", error.code());
  }
  is_active_ = true;
  return {};
}

void MpvDriver::report(bool is_gone) noexcept {
  reports_.write({session_->state(), session_->corrupt_count(), session_->is_late(), is_gone});
}

/// Looks for a newer request several times per period, without any wake-up by the device's thread.
void MpvDriver::run() noexcept {
  const Duration patience = std::max(period_ / 4, Duration{std::chrono::milliseconds{1}});
  bool is_alive = true;
  while (is_alive && !is_stopping_.load(std::memory_order_relaxed)) {
    is_alive = session_->step(requests_.read().value_or(PlayerRequest{}), patience);
    report(!is_alive);
  }
}

driver::ExchangeStatus MpvDriver::exchange(const driver::Command& command,
                                           driver::Sample& sample) noexcept {
  if (!is_active_) return driver::ExchangeStatus::kGone;
  PlayerRequest request;
  if (command.mode == driver::CommandMode::kOutputs) {
    request.rate = clamped(command.outputs[0], -kRateMax, kRateMax, 0);
    request.seek_s = clamped(command.outputs[1], kNowhere, kLengthMaxSeconds, kNowhere);
  }
  requests_.write(request);
  const auto report = reports_.read();
  if (report && report->is_gone) return driver::ExchangeStatus::kGone;
  if (!report || report->is_late) return driver::ExchangeStatus::kLate;
  if (std::exchange(seen_corrupt_count_, report->corrupt_count) != report->corrupt_count) {
    return driver::ExchangeStatus::kCorrupt;
  }
  const PlayerState& player = report->state;
  const double rate = player.is_paused ? 0 : (player.is_backwards ? -player.speed : player.speed);
  sample.host_time = command.cycle_time;
  sample.analogs[0] = analog(player.position_s, 0, kLengthMaxSeconds);
  sample.analogs[1] = analog(rate, -kRateMax, kRateMax);
  sample.analogs[2] = analog(player.duration_s, 0, kLengthMaxSeconds);
  sample.analogs[3] = player.is_paused ? 1 : 0;
  sample.analogs[4] = analog(player.frame_s, 0, 1);
  sample.outputs_applied = {request.rate, request.seek_s};
  return driver::ExchangeStatus::kOk;
}

void MpvDriver::deactivate() noexcept {
  is_stopping_.store(true, std::memory_order_relaxed);
  if (thread_.joinable()) thread_.join();
  is_active_ = false;
  session_.reset();
  transport_.reset();
}

}  // namespace rtpm::device_mpv
