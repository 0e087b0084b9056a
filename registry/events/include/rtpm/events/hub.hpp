#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/events/limits.hpp"
#include "rtpm/events/scalar.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/servant.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/transport/multicast.hpp"

namespace rtpm::events {

/// A hub's multicast: consumers on the LAN with ConsumerConfig::multicast receive datagrams that
/// the hub sends once for all of them, and ask the hub for missing ones.
struct MulticastConfig {
  /// Destination, scope (`hops`) and sending interface.
  transport::MulticastGroup group{};
  /// Datagrams of up to 1400 bytes that are kept for repair; at least 8.
  std::uint32_t history_count = 4096;
};

/// Configures a hub.
struct HubConfig {
  ExchangeLimits limits{};
  Quota quota{};                           ///< Applies to each supplier.
  std::uint32_t supplier_count_max = 256;  ///< A further supplier replaces the one silent longest.
  std::optional<Priority> priority{16'384};  ///< Thread "rtpm-hub"; time-shared if unset.
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  /// The size of the ring for consumers on this host, in bytes: 2^n, at least 64 Ki. If 0, there is
  /// no ring, and each consumer has a stream. nullopt: 4 MiB where the system offers shared memory,
  /// else 0; there create() refuses any other size.
  std::optional<std::uint32_t> ring_size{};
  /// nullopt disables multicast.
  std::optional<MulticastConfig> multicast{};
};

/// Counts what happened to events, of one supplier or of all.
struct IntakeCounters {
  std::uint64_t taken_count = 0;
  std::uint64_t over_quota_count = 0;  ///< Refused: the supplier exceeded its quota.
  std::uint64_t too_large_count = 0;
  std::uint64_t bad_count = 0;        ///< Malformed, or with an invalid type.
  std::uint64_t no_memory_count = 0;  ///< The store is full; see ExchangeLimits::store.
};

struct LinkConfig;
struct LinkStatus;

/// Why a subscription ended.
enum class DisconnectReason : std::uint8_t {
  kUnsubscribed,  ///< The consumer unsubscribed.
  kLeft,          ///< The consumer's session or connection ended, for example with its program.
  /// The consumer missed ConsumerConfig::miss_count_max heartbeats: it is stopped, its handler
  /// hangs, or the network is down.
  kSilent,
  kQueueFull,  ///< The queue was full with QueuePolicy::kDisconnect.
};
/// A clause for messages: "it unsubscribed", "it is gone", ….
[[nodiscard]] std::string_view to_string(DisconnectReason reason) noexcept;

/// A subscription that ended.
struct Disconnect {
  std::uint64_t number = 0;  ///< Consecutive numbers per hub, from 1.
  std::string name{};        ///< The consumer's name.
  DisconnectReason reason = DisconnectReason::kLeft;
  MonotonicTime time{};
};
/// How many subscriptions ended for each reason.
struct DisconnectCounters {
  std::uint64_t unsubscribed_count = 0;
  std::uint64_t left_count = 0;
  std::uint64_t silent_count = 0;
  std::uint64_t queue_full_count = 0;
};
inline constexpr std::size_t kDisconnectCountMax = 64;  ///< Disconnects that a hub keeps.

/// A hub of events, served by rtpm-eventd or any other server. The receiving lane matches an event
/// at the supplier's priority. The lane of a consumer's priority sends to that consumer; consumers
/// on this host read a ring that each event is written to once. The thread "rtpm-hub" runs timeouts
/// and reaps disconnected consumers.
///
/// The hub never waits for a consumer: a slow one fills its own queue, whose policy then applies;
/// every loss is counted and reported. A slow reader of the ring is overrun, and counts its losses
/// itself.
///
///     auto hub = Hub::create().value();
///     auto server = rpc::Server::create(server_config_for(*hub)).value();
///     server->add(kHubPath, hub->servant(), {.checks_callers = true});
///
/// In a server that checks grants, a caller may push events if it has the role command on their
/// path, and may receive events if it has observe on their path: "rtpm/events/TYPE/SOURCE", both in
/// decimal digits. A role on "rtpm/events" applies to all events, one on "rtpm/events/TYPE" to all
/// events of the type.
/// @ownership must outlive the server's stop()
/// @threads  any
class Hub {
 public:
  /// Allocates all memory and starts its thread.
  /// @realtime set-up only
  /// @errors   missing real-time rights with RealtimeMode::kRequire; no memory for the ring
  [[nodiscard]] static expected<std::unique_ptr<Hub>, SetupError> create(
      const HubConfig& config = {});

  Hub(const Hub&) = delete;
  Hub& operator=(const Hub&) = delete;
  virtual ~Hub() = default;

  [[nodiscard]] virtual rpc::Servant& servant() noexcept = 0;
  /// A random number that changes at every start.
  [[nodiscard]] virtual std::uint64_t epoch() const noexcept = 0;

  /// Accepts encoded events from a supplier in this program; Supplier calls it.
  /// @realtime alloc-free; waits at most for concurrent matching, under a priority-inheriting lock
  virtual void push(std::uint64_t supplier, ConstBytes events, Priority priority) noexcept = 0;
  /// Registers a type.
  /// @realtime set-up only
  /// @errors   described in words: the type is registered with another schema, an invalid type or
  ///           field, a limit
  [[nodiscard]] virtual expected<void, SetupError> add_type(const EventDescriptor& descriptor) = 0;

  /// Links to the hub at `target`, a URL or a name, and subscribes there on behalf of its own
  /// consumers. Links one direction; for both, link both hubs. Returns at once: the link connects
  /// when the other hub is reachable, survives its restarts, and ends with this hub. Neither hub
  /// waits for the other. `node` must outlive the hub.
  /// @realtime set-up only
  /// @errors   more than kLinkCountMax links; no thread
  /// @source   spec/events.md#ev-5
  [[nodiscard]] virtual expected<void, SetupError> link(rpc::Node& node, const std::string& target,
                                                        const LinkConfig& config) = 0;
  /// The state of each link, in order of creation.
  /// @realtime set-up only
  [[nodiscard]] virtual std::vector<LinkStatus> links() const = 0;

  /// The largest payload of an event, in bytes.
  [[nodiscard]] virtual std::uint32_t payload_size_max() const noexcept = 0;
  /// The counters over all suppliers.
  [[nodiscard]] virtual IntakeCounters intake() const noexcept = 0;
  [[nodiscard]] virtual std::size_t subscription_count() const noexcept = 0;
  /// The most recent disconnects (at most kDisconnectCountMax) with numbers above `after`, newest
  /// last.
  /// @realtime set-up only
  [[nodiscard]] virtual std::vector<Disconnect> disconnects(std::uint64_t after = 0) const = 0;
  [[nodiscard]] virtual DisconnectCounters disconnect_counters() const noexcept = 0;

 protected:
  Hub() = default;
};

/// The server limits for this hub: one stream per subscription.
[[nodiscard]] rpc::ServerConfig server_config_for(const HubConfig& config);

}  // namespace rtpm::events
