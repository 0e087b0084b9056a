#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/lease.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::gvd {

/// How a client uses a device.
struct DeviceClientOptions {
  rpc::BindOptions bind{};
  /// How long each command stands without a newer one. Ten cycles of a 1 kHz loop: a short hiccup
  /// goes unfelt, a dead loop is off soon after.
  Duration hold = std::chrono::milliseconds{10};
};

/// A device anywhere, used as if it were here: the paper's GVDClient. Reading is open to all;
/// commanding needs the lease, which one client has at a time.
///
///     auto arm = DeviceClient::open(node, "lab/arm0");
///     if (!arm || !arm->acquire()) return …;
///     while (running) {
///       const auto sample = arm->read({.priority = 24000, .deadline = 800us});
///       if (sample) arm->set_force(force_for(sample->pose.position_m), {.priority = 24000});
///     }
///
/// Opened by a name, it follows the name as rpc::Binding does: after an outage read() goes on with
/// the server that the name leads to by now. A command does not: it needs that server's lease, so
/// set_force() gives kNotLeaseHolder until acquire().
/// @ownership refers to its node, which must outlive it. Ends by giving the lease back
/// @threads  read() and set_force() from any, several at once; the rest from one
class DeviceClient {
 public:
  /// Binds `device`, a name for the node's resolver or a URL, and asks what it is.
  /// @realtime set-up only
  /// @errors   as rpc::Binding::bind(); a device that does not answer
  [[nodiscard]] static expected<DeviceClient, rpc::SetupError> open(
      rpc::Node& node, std::string_view device, const DeviceClientOptions& options = {});
  DeviceClient(DeviceClient&&) noexcept;
  DeviceClient& operator=(DeviceClient&&) noexcept;
  ~DeviceClient();

  /// What the device is and can, as it said when it was opened.
  [[nodiscard]] const driver::Descriptor& descriptor() const noexcept;
  /// Where it is by now: "rtpm://host:port/path".
  /// @realtime set-up only
  [[nodiscard]] std::string url() const;
  /// Its own worst case: how long after the last command its force is zero, its period included.
  [[nodiscard]] Duration force_end() const noexcept;

  /// The least priority of a call that may take the lease over, as the device said.
  [[nodiscard]] Priority operator_priority() const noexcept;

  /// The device's newest sample.
  /// @realtime as rpc::Binding::call()
  /// @errors   as CallError · kNoSuchObject while the device has no sample yet
  [[nodiscard]] expected<driver::Sample, rpc::CallError> read(
      const rpc::CallOptions& options = {}) noexcept;
  /// Sets the force, in newton in the device's frame, until the next command or the end of `hold`.
  /// @realtime as rpc::Binding::call()
  /// @errors   as CallError · kNotLeaseHolder: acquire() first, or the lease was lost meanwhile, why
  ///           says lease_state() · kNoSuchObject: the device is not active · kBadRequest: a
  ///           component is not finite, or another thread's newer command came first · kOverload:
  ///           many threads command at this instant
  [[nodiscard]] expected<void, rpc::CallError> set_force(
      const driver::Vector3& force_newton, const rpc::CallOptions& options = {}) noexcept;
  /// Likewise force and torque.
  [[nodiscard]] expected<void, rpc::CallError> set_wrench(
      const driver::Wrench& wrench, const rpc::CallOptions& options = {}) noexcept;

  /// Takes the right to command; if somebody else has it, tries again for `patience`, which covers
  /// a predecessor that died without giving it back.
  /// @realtime set-up only
  /// @errors   as CallError · kNotLeaseHolder: somebody else has it still
  [[nodiscard]] expected<void, rpc::CallError> acquire(Duration patience = std::chrono::seconds{2});
  /// Takes the right to command from its holder, as an operator does whose call has
  /// operator_priority(), or `priority` if that is given. The former holder's calls fail with
  /// kNotLeaseHolder from then on, and its force goes to zero before this client's counts.   Set-up
  /// only.
  /// @errors   as CallError · kNotLeaseHolder: the priority is below the operator's · kOverload: the
  ///           last take-over was less than a second ago: try again
  [[nodiscard]] expected<void, rpc::CallError> take_over(
      std::optional<Priority> priority = std::nullopt);
  /// How the lease stands that this client acquired or took over last, or why it ended: what to ask
  /// for after kNotLeaseHolder. kUnknown after release().
  /// @realtime set-up only
  [[nodiscard]] expected<LeaseState, rpc::CallError> lease_state();
  /// Keeps the lease without a command, for as long as the device bears an idle holder (10 s unless
  /// it says otherwise); commands keep it by themselves.
  /// @realtime set-up only
  [[nodiscard]] expected<void, rpc::CallError> renew();
  /// Gives the lease back; the device takes the force away.
  /// @realtime set-up only
  expected<void, rpc::CallError> release();
  /// Ends a latched fault.
  /// @realtime set-up only
  /// @errors   as CallError · kNotLeaseHolder
  [[nodiscard]] expected<void, rpc::CallError> recover();
  /// Takes the device into operation; the outcome shows in the samples' lifecycle.
  /// @realtime set-up only
  /// @errors   as CallError · kNotLeaseHolder
  [[nodiscard]] expected<void, rpc::CallError> activate();
  /// Takes it out of operation, likewise.
  /// @realtime set-up only
  /// @errors   as CallError · kNotLeaseHolder
  [[nodiscard]] expected<void, rpc::CallError> deactivate();

 private:
  class Impl;
  explicit DeviceClient(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::gvd
