#pragma once

#include <chrono>
#include <memory>
#include <optional>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/configuration/configurable.hpp"
#include "rtpm/driver/driver.hpp"
#include "rtpm/gvd/device.hpp"
#include "rtpm/gvd/error.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/servant.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/safety/flight_recorder.hpp"

namespace rtpm::device {
struct Command;
struct Sample;
}  // namespace rtpm::device

namespace rtpm::gvd {

/// Stands between a device and its clients when a recording is played. Whatever it shows, the
/// device's own cycle decides about their commands.
/// @threads  any lane
/// @realtime alloc-free, without waiting
class ClientView {
 public:
  ClientView() = default;
  ClientView(const ClientView&) = delete;
  ClientView& operator=(const ClientView&) = delete;
  virtual ~ClientView() = default;
  /// The sample that a read() at `now` returns instead of the newest one.
  [[nodiscard]] virtual device::Sample on_read(MonotonicTime now) noexcept = 0;
  /// Records that the device accepted a command (kDone), or refused it.
  virtual void on_command(const device::Command& command, DeviceOutcome outcome,
                          MonotonicTime now) noexcept = 0;
};

/// Configures a device's server.
struct DeviceServerConfig {
  CycleConfig cycle{};
  /// Lets start() succeed without the device, which the server then retries like a lost one. If the
  /// driver does not return within 2 s, start() continues without it; until the driver returns, the
  /// device has no sample.
  bool starts_without_device = false;
  /// The device's thread. Its priority is above every lane's, so that no caller can delay it.
  rt::ThreadConfig thread{.name = "device", .priority = Priority{30000}};
  ClientView* view = nullptr;  ///< May be null; must outlive the server.
};

/// Serves one device: a real-time thread runs the driver periodically, and a servant returns the
/// newest sample and accepts commands. No call waits for the hardware.
///
/// Losing the client, the link or this server brings the force to zero within a stated bound:
/// - the client or the link: within a command's hold, at most SafetyConfig::hold_max, plus
///   SafetyConfig::ramp, plus one period of the device; while models are set,
///   LeaseConfig::silence_max replaces the hold;
/// - this server, stopped normally: at once, by Driver::deactivate();
/// - this process, killed: by the device's own watchdog (see Command::deadline).
/// @ownership owns its driver
/// @threads  create, start and stop from one thread; the rest from any
class DeviceServer {
 public:
  /// Takes ownership of `driver` and checks its descriptor.
  /// @realtime set-up only
  /// @errors   a period outside 20 µs to 100 ms; lease times of zero; an invalid safety limit; an
  ///           inconsistent descriptor; a driver's parameter in the server's group "safety."
  [[nodiscard]] static expected<std::unique_ptr<DeviceServer>, SetupError> create(
      std::unique_ptr<driver::Driver> driver, DeviceServerConfig config = {});

  DeviceServer(const DeviceServer&) = delete;
  DeviceServer& operator=(const DeviceServer&) = delete;
  /// Calls stop(), and waits without bound for a driver that does not return: call stop() first.
  ~DeviceServer();

  /// Configures and activates the device and starts its thread. From then on only that thread calls
  /// the driver.
  /// @realtime set-up only
  /// @errors   the device can't be set up; missing real-time rights with RealtimeMode::kRequire
  [[nodiscard]] expected<void, SetupError> start();

  /// Asks the thread to stop without waiting for it, so that several devices can stop at the same
  /// time.
  /// @threads  any
  /// @realtime alloc-free
  void request_stop() noexcept;
  /// Sets the force to zero, deactivates the device and ends the thread. May be called again,
  /// before or after the rpc::Server's stop().
  /// @param patience  how long to wait for a driver that does not return
  /// @return whether the thread has ended; if not, the device was not deactivated
  /// @realtime set-up only
  bool stop(Duration patience = std::chrono::seconds{2}) noexcept;

  /// Stops this device like DeviceClient::emergency_stop(), but in the same process.
  /// @threads  any
  /// @realtime alloc-free
  void emergency_stop() noexcept;
  /// Whether an emergency stop is in force.
  /// @threads  any
  /// @realtime alloc-free
  [[nodiscard]] bool is_stopped() const noexcept;

  /// The object for an rpc::Server; lives as long as this.
  [[nodiscard]] rpc::Servant& servant() noexcept;
  /// The object that names the lease's holder, for an rpc::Server at holder_path(); lives as long
  /// as this.
  [[nodiscard]] rpc::Servant& holder_servant() noexcept;
  /// The device's parameters and calibrations, for a ConfigurationManager; lives as long as this.
  /// Once started, changes happen between two cycles; before, at once on the caller's thread.
  /// @threads  any
  [[nodiscard]] Configurable& configurable() noexcept;
  [[nodiscard]] const driver::Descriptor& descriptor() const noexcept;
  /// The newest sample, for use in the same process; nullopt before the first.
  /// @realtime alloc-free
  [[nodiscard]] std::optional<driver::Sample> newest() const noexcept;
  /// How long ago an active device completed its last cycle. A long time means that its driver does
  /// not return, or that its thread gets no CPU time.
  /// @threads  any
  /// @realtime alloc-free
  [[nodiscard]] Duration silence() const noexcept;
  [[nodiscard]] DeviceCounters counters() const noexcept;
  /// The cycles around the device's faults.
  [[nodiscard]] const FlightRecorder& flight_recorder() const noexcept;

 private:
  struct Impl;
  explicit DeviceServer(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::gvd
