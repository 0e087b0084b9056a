#include "rtpm/device_vrpn/vrpn_driver.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/rt/clock.hpp"

namespace rtpm::device_vrpn {

VrpnDriver::VrpnDriver(Settings settings, std::string serial, std::string frame)
    : settings_(settings),
      serial_(std::move(serial)),
      frame_(std::move(frame)),
      client_(std::move(settings)) {}

VrpnDriver::~VrpnDriver() {
  VrpnDriver::deactivate();
}

driver::Descriptor VrpnDriver::describe() const {
  driver::Descriptor descriptor{.device_class = driver::DeviceClass::kTracker,
                                .model = "VRPN tracker " + settings_.tracker,
                                .serial = serial_,
                                .frame = frame_};
  for (const char* axis : {"x", "y", "z", "rx", "ry", "rz"})
    descriptor.axes.push_back({.name = axis, .is_sensed = true});
  // VRPN does not tell it: a room.
  descriptor.workspace = {.low_m = {-10, -10, -10}, .high_m = {10, 10, 10}};
  descriptor.rate_hz = 100;
  return descriptor;
}

expected<void, SetupError> VrpnDriver::configure(const driver::DriverConfig& config) {
  if (config.period <= Duration{0}) {
    return setup_error("the VRPN driver needs a period above zero", "", "set --rate");
  }
  deactivate();
  if (auto opened = client_.open(kStartMax); !opened) return opened;
  const MonotonicTime end = rt::now() + kStartMax;
  const std::uint64_t before = client_.reading().count;
  while (client_.reading().count == before && rt::now() < end) {
    if (client_.step(end - rt::now())) continue;
    client_.close();
    return setup_error("the VRPN server ended the connection");
  }
  if (client_.reading().count != before) return {};
  client_.close();
  return setup_error("the VRPN server sends no report of " + settings_.tracker + " sensor " +
                         std::to_string(settings_.sensor),
                     "", "check tracker= and sensor= of the driver's arguments");
}

expected<void, SetupError> VrpnDriver::activate() {
  if (!client_.is_open() || is_active_) return setup_error("the VRPN driver is not configured");
  reports_.write({.reading = client_.reading()});
  const rt::ThreadConfig thread{.name = "vrpn", .realtime = rt::RealtimeMode::kOff};
  if (auto started = thread_.start(thread, [this] { return step(); }); !started) return started;
  is_active_ = true;
  return {};
}

bool VrpnDriver::step() noexcept {
  const bool is_alive = client_.step(std::chrono::milliseconds{50});
  reports_.write({.reading = client_.reading(), .is_gone = !is_alive});
  return is_alive;
}

driver::ExchangeStatus VrpnDriver::exchange(const driver::Command& command,
                                            driver::Sample& sample) noexcept {
  const auto report = reports_.read();
  if (!is_active_ || !report || report->is_gone) return driver::ExchangeStatus::kGone;
  const Duration age = command.cycle_time - report->reading.time;
  if (age > kGoneAfter) return driver::ExchangeStatus::kGone;
  if (age > kLateAfter) return driver::ExchangeStatus::kLate;
  // A report may arrive after the cycle's time.
  sample.host_time = std::min(report->reading.time, command.cycle_time);
  sample.pose = report->reading.pose;
  return driver::ExchangeStatus::kOk;
}

void VrpnDriver::deactivate() noexcept {
  thread_.stop();
  is_active_ = false;
  client_.close();
}

}  // namespace rtpm::device_vrpn
