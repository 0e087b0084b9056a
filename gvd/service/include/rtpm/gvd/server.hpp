#pragma once

#include <memory>
#include <optional>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/driver/driver.hpp"
#include "rtpm/gvd/device.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/servant.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::gvd {

/// How a device is served.
struct DeviceServerConfig {
  CycleConfig cycle{};
  /// The device's thread. Its priority lies above every lane's, so that no caller can delay it.
  rt::ThreadConfig thread{.name = "device", .priority = Priority{30000}};
};

/// Serves one device: a real-time thread runs the driver at a steady pace, and a servant gives its
/// newest sample to callers and takes their commands. No call ever waits for the hardware.
///
/// Losing the client, the link or this server brings the force to zero within a stated bound:
/// - the client or the link: a command's hold, at most SafetyConfig::hold_max, then
///   SafetyConfig::ramp, then one period of the device;
/// - this server, stopped in order: at once, by Driver::deactivate();
/// - this process, killed: what the device's own watchdog gives (Command::deadline tells it when).
/// @ownership owns its driver
/// @threads  create, start and stop from one thread; the rest from any
class DeviceServer {
 public:
  /// Takes `driver` and checks what it says of itself.
  /// @realtime set-up only
  /// @errors   a period that is not 20 µs to 100 ms, a lease that is over at once, a safety limit
  ///           that can't be used, a descriptor that contradicts itself
  [[nodiscard]] static expected<std::unique_ptr<DeviceServer>, rpc::SetupError> create(
      std::unique_ptr<driver::Driver> driver, DeviceServerConfig config = {});

  DeviceServer(const DeviceServer&) = delete;
  DeviceServer& operator=(const DeviceServer&) = delete;
  /// Stops.
  ~DeviceServer();

  /// Configures and activates the device and starts its thread, which calls the driver alone from
  /// here on.
  /// @realtime set-up only
  /// @errors   the device can't be set up; with RealtimeMode::kRequire, a right that the process
  ///           lacks
  [[nodiscard]] expected<void, rpc::SetupError> start();

  /// Takes the force away, deactivates the device and ends the thread; again is allowed. Stop the
  /// rpc::Server that serves it before or after, in either order.
  /// @realtime set-up only
  void stop() noexcept;

  /// What an rpc::Server serves for this device; lives as long as this.
  [[nodiscard]] rpc::Servant& servant() noexcept;
  [[nodiscard]] const driver::Descriptor& descriptor() const noexcept;
  /// The newest sample, for use in the same process; nothing before the first.
  /// @realtime alloc-free
  [[nodiscard]] std::optional<driver::Sample> newest() const noexcept;
  [[nodiscard]] DeviceCounters counters() const noexcept;

 private:
  class Impl;
  explicit DeviceServer(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::gvd
