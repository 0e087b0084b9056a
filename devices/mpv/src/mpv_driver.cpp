#include "rtpm/device_mpv/mpv_driver.hpp"

#include <algorithm>
#include <utility>

namespace rtpm::device_mpv {

MpvDriver::MpvDriver(OpenTransport open, std::string serial, std::string frame)
    : open_(std::move(open)), serial_(std::move(serial)), frame_(std::move(frame)) {}

MpvDriver::~MpvDriver() {
  MpvDriver::deactivate();
}

driver::Descriptor MpvDriver::describe() const {
  return player_descriptor(serial_, frame_);
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

/// Sends no command, so that the player's state does not change.
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
  const rt::ThreadConfig thread{.name = "mpv", .realtime = rt::RealtimeMode::kOff};
  if (auto started = thread_.start(thread, [this] { return step(); }); !started) return started;
  is_active_ = true;
  return {};
}

void MpvDriver::report(bool is_gone) noexcept {
  reports_.write({session_->state(), session_->corrupt_count(), session_->is_late(), is_gone});
}

/// Checks for a newer request several times per period, so that the device's thread need not wake
/// this thread.
bool MpvDriver::step() noexcept {
  const Duration patience = std::max(period_ / 4, Duration{std::chrono::milliseconds{1}});
  const bool is_alive = session_->step(requests_.read().value_or(PlayerRequest{}), patience);
  report(!is_alive);
  return is_alive;
}

driver::ExchangeStatus MpvDriver::exchange(const driver::Command& command,
                                           driver::Sample& sample) noexcept {
  if (!is_active_) return driver::ExchangeStatus::kGone;
  const PlayerRequest request = request_of(command);
  requests_.write(request);
  const auto report = reports_.read();
  if (report && report->is_gone) return driver::ExchangeStatus::kGone;
  if (!report || report->is_late) return driver::ExchangeStatus::kLate;
  if (std::exchange(seen_corrupt_count_, report->corrupt_count) != report->corrupt_count) {
    return driver::ExchangeStatus::kCorrupt;
  }
  sample.host_time = command.cycle_time;
  fill(sample, report->state, request);
  return driver::ExchangeStatus::kOk;
}

void MpvDriver::deactivate() noexcept {
  thread_.stop();
  is_active_ = false;
  session_.reset();
  transport_.reset();
}

}  // namespace rtpm::device_mpv
