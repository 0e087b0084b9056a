#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "rtpm/base/expected.hpp"
#include "settings.hpp"
#include "sides/event_board.hpp"
#include "sides/network_pair.hpp"
#include "sides/server_process.hpp"

/// The two contenders of the events case: a hub, its supplier and consumers; and what the sockets
/// themselves cost: a relay that forwards each datagram to all that joined.
namespace rtpm::bench {

/// How both sides are set up.
struct EventSetting {
  Carrier carrier = Carrier::kSharedMemory;  ///< The carrier of RTPM; the floor uses UDP.
  rt::WaitConfig wait{};                     ///< The hub's lane and the relay use it.
  int consumer_count = 1;
  /// The hub and its users run in this program: no transport between them.
  bool is_embedded = false;
  /// The hub runs in the supplier's program and on its CPU, as without a broker: a pushed event
  /// stays in the program, and goes to the consumers by the transport. The floor has no relay.
  bool has_own_hub = false;
  /// The hub sends each event once, by multicast on this host, and not to each consumer. The floor
  /// sends to each.
  bool is_multicast = false;
  std::uint32_t type = 1;   ///< The type of the events pushed and subscribed to.
  std::string pushed_to{};  ///< The supplier's hub; empty if it is the consumers'.
  std::string linked_to{};  ///< The hub whose events this one takes; may be empty.
  /// Two hosts: hub and relay on one, supplier and consumers on the other. Null for a single host.
  const NetworkPair* network = nullptr;
  Placement placement{};
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
};

/// Supplier and consumers of one side. Threads: push() from one.
class EventSide {
 public:
  virtual ~EventSide() = default;
  [[nodiscard]] virtual expected<void, std::string> push(const EventStamp& stamp) = 0;
  /// Lets the last `count` consumers take a tenth of a second for each event, or stops that. Only a
  /// hub's consumers can be slow.
  virtual void set_slow(int count) { static_cast<void>(count); }
  /// Losses that were reported to the consumers. Only a hub reports them.
  [[nodiscard]] virtual std::uint64_t lost_count() const { return 0; }
};

/// Starts a process between supplier and consumers: on the server's host, where there are two.
[[nodiscard]] expected<ServerProcess, std::string> start_between(
    const EventSetting& setting, const ServerProcess::SetUp& set_up);
/// Starts a hub in a process of its own. Fork it before this process starts a thread.
[[nodiscard]] expected<ServerProcess, std::string> start_event_hub(const EventSetting& setting);
/// A hub in this program, with the lane that start_event_hub() would give it. It serves as long as
/// this object lives, which must outlive the hub's users.
class EventHub {
 public:
  virtual ~EventHub() = default;
  [[nodiscard]] virtual std::string url() const = 0;
};
[[nodiscard]] expected<std::unique_ptr<EventHub>, std::string> open_event_hub(
    const EventSetting& setting);
/// Starts a process of `count` consumers that record nothing: to be stopped.
[[nodiscard]] expected<ServerProcess, std::string> start_idle_consumers(const EventSetting& setting,
                                                                        const std::string& hub,
                                                                        int count);
/// Starts the floor's relay in a process of its own.
[[nodiscard]] expected<ServerProcess, std::string> start_event_relay(const EventSetting& setting);

[[nodiscard]] expected<std::unique_ptr<EventSide>, std::string> connect_events(
    const EventSetting& setting, const std::string& hub, EventBoard& board);
/// `relay` may be empty: without a relay the supplier sends to each consumer itself.
[[nodiscard]] expected<std::unique_ptr<EventSide>, std::string> connect_relay(
    const EventSetting& setting, const std::string& relay, EventBoard& board);

/// The rate at which events went through, in events a second.
struct EventRate {
  double events_per_s = 0;          ///< Received by one consumer, in the best of three bursts.
  std::uint64_t missing_count = 0;  ///< Pushed and not received, in all bursts,
  std::uint64_t lost_count = 0;     ///< and how many of those were reported to the consumer.
};
/// One supplier pushes as many as it can, in batches; one consumer takes them.
[[nodiscard]] expected<EventRate, std::string> measure_event_rate(const EventSetting& setting,
                                                                  const std::string& hub);

}  // namespace rtpm::bench
