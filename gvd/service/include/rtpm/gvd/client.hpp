#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/command.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/emergency.hpp"
#include "rtpm/gvd/error.hpp"
#include "rtpm/gvd/lease.hpp"
#include "rtpm/models/model.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/safety/flight_recorder.hpp"

namespace rtpm::gvd {

/// Configures a client.
struct DeviceClientOptions {
  rpc::BindOptions bind{};
  /// How long a command lasts without a newer one: ten cycles of a 1 kHz loop, to bridge a short
  /// delay.
  Duration hold = std::chrono::milliseconds{10};
  /// How long open() waits for a device that does not exist yet.
  Duration patience{0};
};

/// The result of a call without another return value.
using DeviceResult = expected<void, DeviceError>;

/// Why a device refused a list of models.
struct ModelsError {
  DeviceError error;
  /// A message for people; for kOutOfRange "model 2 (plane): stiffness_newton_per_m is 1e+09;
  /// choose 0 to 1667".
  std::string text{};
};

/// A remote device as a local object: the paper's GVDClient. Any client may read; commands need the
/// lease, which one client holds at a time.
///
///     auto arm = DeviceClient::open(node, "lab/arm0");
///     if (!arm || !arm->acquire()) return …;
///     while (running) {
///       const auto sample = arm->read({.priority = 24000, .deadline = 800us});
///       if (sample) arm->set_force(force_for(sample->pose.position_m), {.priority = 24000});
///     }
///
/// A client opened by name follows the name as rpc::Binding does: read() continues with the new
/// server; set_force() returns kNotHolder until acquire() succeeds there.
/// @ownership refers to its node, which must outlive it; releases the lease when destroyed
/// @threads  read() and set_force(): any, concurrently; the rest: one
class DeviceClient {
 public:
  /// Binds `device`, a name or a URL, and reads its descriptor. Retries failures for
  /// `options.patience`, except another interface or a missing right.
  /// @realtime set-up only
  /// @errors   those of rpc::Binding::bind(); the device does not answer
  [[nodiscard]] static expected<DeviceClient, SetupError> open(
      rpc::Node& node, std::string_view device, const DeviceClientOptions& options = {});
  DeviceClient(DeviceClient&&) noexcept;
  DeviceClient& operator=(DeviceClient&&) noexcept;
  ~DeviceClient();

  /// The device's descriptor, as read by open().
  [[nodiscard]] const driver::Descriptor& descriptor() const noexcept;
  /// The current URL, "rtpm://host:port/path".
  /// @realtime set-up only
  [[nodiscard]] std::string url() const;
  /// The device's worst case: how long after the last command its force is zero, including its
  /// period.
  [[nodiscard]] Duration force_end() const noexcept;

  /// The minimum priority of take_over(), as read by open().
  [[nodiscard]] Priority operator_priority() const noexcept;

  /// The device's newest sample.
  /// @realtime like rpc::Binding::call()
  /// @errors   kNoSample · kCallFailed
  [[nodiscard]] expected<driver::Sample, DeviceError> read(
      const rpc::CallOptions& options = {}) noexcept;
  /// Sets the force, in newton in the device's frame, until the next command or the end of `hold`.
  /// Outputs do not change.
  /// @realtime like rpc::Binding::call()
  /// @errors   those of set()
  [[nodiscard]] DeviceResult set_force(const driver::Vector3& force_newton,
                                       const rpc::CallOptions& options = {}) noexcept;
  /// Sets force and torque, like set_force().
  [[nodiscard]] DeviceResult set_wrench(const driver::Wrench& wrench,
                                        const rpc::CallOptions& options = {}) noexcept;

  /// Sets wrench, pose, velocity, joints or outputs, by Setpoint::mode, until the next command or
  /// the end of `hold`. Then force and efforts fall to zero, motion stops, and outputs take their
  /// safe values. CommandMode::kOutputs leaves force and motion unchanged, and a force or motion
  /// setpoint whose outputs are all zero leaves the outputs unchanged, so one thread can command a
  /// force and another one a vibration.
  /// @realtime like rpc::Binding::call()
  /// @errors   kNotHolder · kNotActive · kWrongMode · kSuperseded · kNotFinite · kTooMany ·
  ///           kEmergencyStop · kCallFailed
  [[nodiscard]] DeviceResult set(const driver::Setpoint& setpoint,
                                 const rpc::CallOptions& options = {}) noexcept;

  /// Makes the device's own loop render `models`, at most ModelList::kCountMax, from its next cycle
  /// on; they replace the previous ones. Their force is added to the commands' and passes the same
  /// limits. It needs the lease, but no command and no link. It ends with the lease, by the ramp:
  /// if this client falls silent, after LeaseConfig::silence_max (1 s), not after `hold`. To keep
  /// the lease, call set_models() again, or command; renew() alone keeps it for 10 s. A lost
  /// device, deactivate(), an emergency stop and recover() also end the models. An empty list
  /// removes them.
  /// @realtime set-up only
  /// @errors   kNotHolder · kNotActive · kOutOfRange · kSuperseded · kTooMany · kEmergencyStop ·
  ///           kCallFailed; the previous models stay in force
  [[nodiscard]] expected<void, ModelsError> set_models(std::span<const Model> models);

  /// The cycles around the device's newest fault; its number is 0 if there was none. Times are on
  /// the clock of the device's host.
  /// @realtime set-up only
  /// @errors   kCallFailed
  [[nodiscard]] expected<FlightLog, DeviceError> flight_record();

  /// Acquires the lease. While another client holds it, retries for `patience`; the default
  /// outlasts the lease of a crashed client, but not of a crashed operator (5 s).
  /// @realtime set-up only
  /// @errors   kHeld · kTooSoon · kCallFailed
  [[nodiscard]] DeviceResult acquire(Duration patience = std::chrono::seconds{2});
  /// Acquires the lease again after a call failed with kNotHolder, like acquire(), but not if an
  /// operator took it over: then only acquire() asks for it. Does nothing while the lease is held.
  /// @realtime set-up only
  /// @errors   kNotHolder: an operator took it over · those of acquire()
  [[nodiscard]] DeviceResult reacquire(Duration patience = std::chrono::seconds{2});
  /// Takes the lease from its holder, with operator_priority() or `priority`. The previous holder's
  /// calls fail with kNotHolder, and its force goes to zero before this client's commands apply.
  /// @realtime set-up only
  /// @errors   kBelowOperatorPriority · kTooSoon · kCallFailed
  [[nodiscard]] DeviceResult take_over(std::optional<Priority> priority = std::nullopt);
  /// The state of this client's last lease, or why it ended; use it after kNotHolder. kUnknown
  /// after release().
  /// @realtime set-up only
  [[nodiscard]] expected<LeaseState, DeviceError> lease_state();
  /// Keeps the lease without a command, up to LeaseConfig::idle_max (10 s). Commands also keep it.
  /// @realtime set-up only
  [[nodiscard]] DeviceResult renew();
  /// Releases the lease; the force goes to zero.
  /// @realtime set-up only
  DeviceResult release();
  /// Clears a latched fault.
  /// @realtime set-up only
  /// @errors   kNotHolder · kCallFailed
  [[nodiscard]] DeviceResult recover();
  /// Activates the device; Sample::lifecycle shows the result.
  /// @realtime set-up only
  /// @errors   kNotHolder · kCallFailed
  [[nodiscard]] DeviceResult activate();
  /// Deactivates the device; Sample::lifecycle shows the result.
  /// @realtime set-up only
  /// @errors   kNotHolder · kCallFailed
  [[nodiscard]] DeviceResult deactivate();
  /// Removes the force of each device in `scope` at once, and refuses commands until rearm(). Needs
  /// no lease.
  /// @realtime set-up only
  /// @errors   kNotInSystem, with kSystem · kCallFailed
  [[nodiscard]] DeviceResult emergency_stop(StopScope scope = StopScope::kDevice);
  /// Ends an emergency stop; the force returns by soft start.
  /// @realtime set-up only
  /// @errors   kNotHolder · kCallFailed
  [[nodiscard]] DeviceResult rearm();

 private:
  struct Impl;
  [[nodiscard]] static expected<DeviceClient, SetupError> open_once(
      rpc::Node& node, std::string_view device, const DeviceClientOptions& options);
  explicit DeviceClient(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::gvd
