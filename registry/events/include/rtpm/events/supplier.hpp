#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/events/hub.hpp"
#include "rtpm/events/scalar.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::events {

/// How a supplier is set up.
struct SupplierConfig {
  std::string name = "supplier";  ///< For people, in the hub's report.
  Priority priority{};            ///< Of its events, and at which they are matched.
  /// What its events are, so that consumers may filter by their fields. Constants of static life.
  std::vector<const EventDescriptor*> types{};
  std::uint8_t hops = 1;  ///< How many further hubs may send its events on.
  /// How often it asks the hub what became of its events and how its clock stands.
  Duration attend_interval = std::chrono::milliseconds{250};
  rpc::Transport transport = rpc::Transport::kAuto;
  Duration deadline = std::chrono::seconds{1};  ///< Of create().
};

/// What is pushed, but for what the supplier adds by itself.
struct EventDraft {
  EventType type = 0;
  SourceId source = 0;
  std::uint64_t schema_id = 0;
  ConstBytes payload{};
  std::optional<MonotonicTime> origin{};  ///< On this host's clock; none: now.
  std::optional<std::uint8_t> hops{};     ///< None: SupplierConfig::hops.
};

/// What a supplier knows of the arrival of its events. Each event that was sent or failed has the
/// next number of its type and source (EventHeader::sequence), so what did not arrive is a gap in
/// the numbers that a consumer gets, of exactly so many.
struct SupplierCounters {
  std::uint64_t sent_count = 0;
  /// Not sent: add(), push() or flush() gave an error.
  std::uint64_t failed_count = 0;
  /// Of those sent: on their way, or not counted by the hub when it was last asked
  /// (SupplierConfig::attend_interval). Over UDP also those that the network lost.
  std::uint64_t unconfirmed_count = 0;
  /// Of those sent: may not have arrived, as the hub or the connection ended before the hub counted
  /// them. An upper bound; over shared memory the ring tells which were read, so at most the last
  /// frame that was read is counted though it arrived. Falls if the same hub counts them later.
  std::uint64_t maybe_lost_count = 0;
};

/// Pushes events to a hub: one elsewhere, or one in this program. It never waits for a consumer,
/// nor for the hub's answer; what the hub refused it tells later (intake()). When the hub restarts,
/// it goes on with the new one, and one push() in between gives kMaybeLost if events may not have
/// arrived: counters() tells how many. Events of a type and a source come in their order, whatever
/// threads push them; but UDP may lose some.
/// @ownership refers to its node or hub, which must outlive it
/// @threads  push(), add() and flush() from any, one waits for the other's copy
class Supplier {
 public:
  /// Binds the hub at `target`, a URL or a name.
  /// @realtime set-up only. A time-shared thread "rtpm-attend" stays
  /// @errors   no hub there; a type that the hub knows by another schema
  [[nodiscard]] static expected<std::unique_ptr<Supplier>, rpc::SetupError> create(
      rpc::Node& node, const std::string& target, const SupplierConfig& config = {});
  /// The same for a hub in this program: events take no way at all.
  [[nodiscard]] static expected<std::unique_ptr<Supplier>, rpc::SetupError> create(
      Hub& hub, const SupplierConfig& config = {});
  Supplier(const Supplier&) = delete;
  Supplier& operator=(const Supplier&) = delete;
  ~Supplier();

  /// Pushes one event, and what add() has gathered before it. The payload is copied.
  /// @realtime alloc-free; one send, as any oneway call
  /// @errors   kTooLarge: more than the hub takes · kMaybeLost: this one and what was gathered was
  ///           not sent, and earlier ones may not have arrived: see counters(); others: as any
  ///           oneway call that is merely sent. Try again with the next event
  [[nodiscard]] expected<void, rpc::CallError> push(const EventDraft& event) noexcept;
  /// Gathers an event for the next flush(), which comes by itself when no more fit a frame.
  /// @realtime as push()
  /// @errors   as push(); the event was not gathered and has no number
  [[nodiscard]] expected<void, rpc::CallError> add(const EventDraft& event) noexcept;
  /// Pushes what was gathered, in one frame.
  /// @realtime as push()
  [[nodiscard]] expected<void, rpc::CallError> flush() noexcept;

  /// What is known of the arrival of its events, over all lives of the hub.
  /// @threads  any, waits as push() does
  /// @realtime alloc-free
  [[nodiscard]] SupplierCounters counters() const noexcept;
  /// What became of its events in this life of the hub, as the hub said when it was last asked.
  [[nodiscard]] IntakeCounters intake() const noexcept;
  /// A random number: by it hubs tell it apart.
  [[nodiscard]] std::uint64_t id() const noexcept;
  /// Whether the hub answered when it was last asked.
  [[nodiscard]] bool is_attended() const noexcept;

 private:
  class Impl;
  explicit Supplier(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::events
