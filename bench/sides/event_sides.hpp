#pragma once

#include <memory>
#include <string>

#include "outcome.hpp"
#include "rtpm/events/hub.hpp"
#include "rtpm/rpc/server.hpp"
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
  /// The hub runs in the supplier's program and on its CPU, as without a broker: a pushed event
  /// stays in the program, and goes to the consumers by the transport. The floor has no relay.
  bool has_own_hub = false;
  /// The hub sends each event once, by multicast on this host, and not to each consumer. The floor
  /// sends to each.
  bool is_multicast = false;
  /// Two hosts: hub and relay on one, supplier and consumers on the other. Null for a single host.
  const NetworkPair* network = nullptr;
  Placement placement{};
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
};

/// Starts a process between supplier and consumers: on the server's host, where there are two.
[[nodiscard]] Outcome<ServerProcess> start_between(const EventSetting& setting,
                                                   const ServerProcess::SetUp& set_up);
/// Starts a hub in a process of its own. Fork it before this process starts a thread.
[[nodiscard]] Outcome<ServerProcess> start_event_hub(const EventSetting& setting);
/// A hub in this program. It must outlive its users.
struct EventHub {
  [[nodiscard]] std::string url() const;
  std::unique_ptr<events::Hub> hub;
  std::unique_ptr<rpc::Server> server;
};
/// Opens a hub with the lane that start_event_hub() would give it.
[[nodiscard]] Outcome<EventHub> open_event_hub(const EventSetting& setting);
/// Starts a process of `count` consumers that record nothing: to be stopped.
[[nodiscard]] Outcome<ServerProcess> start_idle_consumers(const EventSetting& setting,
                                                          const std::string& hub, int count);
/// Starts the floor's relay in a process of its own.
[[nodiscard]] Outcome<ServerProcess> start_event_relay(const EventSetting& setting);

[[nodiscard]] Outcome<std::unique_ptr<EventSide>> connect_events(const EventSetting& setting,
                                                                 const std::string& hub,
                                                                 EventBoard& board);
/// `relay` may be empty: without a relay the supplier sends to each consumer itself.
[[nodiscard]] Outcome<std::unique_ptr<EventSide>> connect_relay(const EventSetting& setting,
                                                                const std::string& relay,
                                                                EventBoard& board);

/// The rate at which events went through, in events a second.
struct EventRate {
  double events_per_s = 0;          ///< Received by one consumer, in the best of three bursts.
  std::uint64_t missing_count = 0;  ///< Pushed and not received, in all bursts,
  std::uint64_t lost_count = 0;     ///< and how many of those were reported to the consumer.
};
/// One supplier pushes as many as it can, in batches; one consumer takes them.
[[nodiscard]] Outcome<EventRate> measure_event_rate(const EventSetting& setting,
                                                    const std::string& hub);

}  // namespace rtpm::bench
