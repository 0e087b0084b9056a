#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/events/hub.hpp"
#include "rtpm/events/scalar.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::events {

/// Configures a supplier.
struct SupplierConfig {
  std::string name = "supplier";  ///< Shown in the hub's report.
  Priority priority{};            ///< The priority of its events, and of matching them.
  /// The types of its events, for filters on their fields; constants with static lifetime.
  std::vector<const EventDescriptor*> types{};
  std::uint8_t hops = 1;  ///< How many further hubs may forward its events.
  /// The interval at which the hub's counters and clock are read.
  Duration attend_interval = std::chrono::milliseconds{250};
  rpc::Transport transport = rpc::Transport::kAuto;
  Duration deadline = std::chrono::seconds{1};  ///< Bounds create().
};

/// An event to push; the supplier adds sequence, priority and clock.
struct EventDraft {
  EventType type = 0;
  SourceId source = 0;
  std::uint64_t schema_id = 0;
  ConstBytes payload{};
  std::optional<MonotonicTime> origin{};  ///< Time on this host's clock; nullopt means now.
  std::optional<std::uint8_t> hops{};     ///< By default SupplierConfig::hops.
};

/// The delivery of a supplier's events to the hub. Both sent and failed events consume a sequence
/// number of their type and source, so consumers see lost events as gaps.
struct SupplierCounters {
  std::uint64_t sent_count = 0;
  /// Events not sent: add(), push() or flush() returned an error.
  std::uint64_t failed_count = 0;
  /// Sent, but not yet counted by the hub when last queried (SupplierConfig::attend_interval); over
  /// UDP this includes network losses.
  std::uint64_t unconfirmed_count = 0;
  /// Sent, but possibly lost: hub or connection ended before the hub counted them. An upper bound;
  /// over shared memory it is exact up to the last frame that was read. Decreases if the same hub
  /// counts them later.
  std::uint64_t maybe_lost_count = 0;
};

/// Pushes events to a hub, remote or in this program. Never waits for a consumer or a reply;
/// intake() counts the events that the hub refused. After a restart of the hub it continues with
/// the new hub, and one push() returns kMaybeLost if events may be lost (see counters()). Events of
/// one type and source arrive in order; UDP may lose some.
/// @ownership refers to its node or hub, which must outlive it
/// @threads  push(), add() and flush(): any; each waits while another one copies
class Supplier {
 public:
  /// Binds the hub at `target`, a URL or a name.
  /// @realtime set-up only; starts a time-shared thread "rtpm-attend"
  /// @errors   no hub answers; the hub knows a type with another schema
  [[nodiscard]] static expected<std::unique_ptr<Supplier>, SetupError> create(
      rpc::Node& node, const std::string& target, const SupplierConfig& config = {});
  /// Creates a supplier for a hub in this program, which pushes without a call.
  [[nodiscard]] static expected<std::unique_ptr<Supplier>, SetupError> create(
      Hub& hub, const SupplierConfig& config = {});
  Supplier(const Supplier&) = delete;
  Supplier& operator=(const Supplier&) = delete;
  ~Supplier();

  /// Pushes one event, after the batch collected by add(). Copies the payload.
  /// @realtime alloc-free; one send, as any oneway call
  /// @errors   kTooLarge: larger than the hub accepts · kMaybeLost: this batch was not sent and
  ///           earlier ones may be lost, see counters() · other errors: as any oneway call; retry
  ///           with the next event
  [[nodiscard]] expected<void, rpc::CallError> push(const EventDraft& event) noexcept;
  /// Adds an event to the batch for the next flush(); a full batch is flushed automatically.
  /// @realtime like push()
  /// @errors   those of push(); the event was not added and has no sequence number
  [[nodiscard]] expected<void, rpc::CallError> add(const EventDraft& event) noexcept;
  /// Pushes the batch in one frame.
  /// @realtime like push()
  [[nodiscard]] expected<void, rpc::CallError> flush() noexcept;

  /// Delivery counters, across restarts of the hub.
  /// @threads  any; waits like push()
  /// @realtime alloc-free
  [[nodiscard]] SupplierCounters counters() const noexcept;
  /// The hub's counters for this supplier's events since the hub started, as last read.
  [[nodiscard]] IntakeCounters intake() const noexcept;
  /// A random number that identifies the supplier to hubs.
  [[nodiscard]] std::uint64_t id() const noexcept;

 private:
  class Impl;
  explicit Supplier(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::events
