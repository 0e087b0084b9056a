#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
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

/// A multicast of a hub: consumers on the LAN that ask for it (ConsumerConfig::multicast) get their
/// events in datagrams that are sent once for all of them, and ask the hub for those that they
/// miss.
struct MulticastConfig {
  /// To send to; its `hops` and `interface` say how far and by which interface.
  transport::MulticastGroup group{};
  /// Datagrams, of up to 1400 bytes, that the hub keeps for repair; at least 8.
  std::uint32_t history_count = 4096;
  /// To try the repair out: of so many datagrams one is not sent, 0: all are.
  std::uint32_t lose_every = 0;
};

/// How a hub is set up.
struct HubConfig {
  ExchangeLimits limits{};
  Quota quota{};                             ///< Of each supplier.
  std::uint32_t supplier_count_max = 256;    ///< More take the place of the longest silent one.
  std::optional<Priority> priority{16'384};  ///< Of its own thread, which keeps timeouts.
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  /// Bytes of the ring that consumers on this host read, 2^n of at least 64 Ki; 0: none, each gets
  /// its events in a stream of its own.
  std::uint32_t ring_size = 4 * 1024 * 1024;
  /// None: no multicast.
  std::optional<MulticastConfig> multicast{};
};

/// What became of the events of a supplier, or of all.
struct IntakeCounters {
  std::uint64_t taken_count = 0;
  std::uint64_t over_quota_count = 0;  ///< Refused: the supplier pushes more than it may.
  std::uint64_t too_large_count = 0;
  std::uint64_t bad_count = 0;        ///< No event, or of no type.
  std::uint64_t no_memory_count = 0;  ///< The hub is too small for what its consumers hold.
};

struct LinkConfig;
struct LinkStatus;

/// Why a subscription ended.
enum class DisconnectReason : std::uint8_t {
  kUnsubscribed,  ///< Its consumer wanted so.
  kLeft,          ///< Its consumer's session or connection ended: the program ended, or was killed.
  /// Its consumer missed as many signs of life as it may (ConsumerConfig::miss_count_max): it is
  /// stopped, hangs in its handler, or the network is gone.
  kSilent,
  kQueueFull,  ///< Its queue was full, and its policy is to end then.
};
/// "it unsubscribed", "it is gone", …: what became of the consumer.
[[nodiscard]] std::string_view to_string(DisconnectReason reason) noexcept;

/// A subscription that ended.
struct Disconnect {
  std::uint64_t number = 0;  ///< Counts those of the hub, from 1.
  std::string name{};        ///< The consumer's.
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
inline constexpr std::size_t kDisconnectCountMax = 64;  ///< That a hub remembers.

/// A hub of events, as an object for any server: rtpm-eventd's, or one in the supplier's own
/// program. Suppliers' events are matched in the lane that receives them, at their priority; each
/// consumer's are sent by the lane of its own, or stand in a ring that all consumers on this host
/// read: then an event is written once, however many want it. A thread "rtpm-hub" keeps timeouts
/// and clears away those who left.
///
/// Nobody waits for a consumer: what one does not take waits in its own queue, then is dropped,
/// counted, and told. Who reads the ring too slowly is overrun, which the hub does not even notice.
///
///     auto hub = Hub::create().value();
///     auto server = rpc::Server::create(server_config_for(*hub)).value();
///     server->add(kHubPath, hub->servant());
/// @ownership must outlive the server's stop()
/// @threads  any
class Hub {
 public:
  /// Takes all its memory and starts its thread.
  /// @realtime set-up only
  /// @errors   with RealtimeMode::kRequire, a right that the process lacks; no memory for the ring
  [[nodiscard]] static expected<std::unique_ptr<Hub>, rpc::SetupError> create(
      const HubConfig& config = {});

  Hub(const Hub&) = delete;
  Hub& operator=(const Hub&) = delete;
  virtual ~Hub() = default;

  [[nodiscard]] virtual rpc::Servant& servant() noexcept = 0;
  /// Another in each life.
  [[nodiscard]] virtual std::uint64_t epoch() const noexcept = 0;

  /// Takes events, one encoded after the other, from a supplier in this program; what Supplier does
  /// by itself.
  /// @realtime alloc-free; waits for nobody but who matches events at the same time, by a lock that
  ///           passes priority on
  virtual void push(std::uint64_t supplier, ConstBytes events, Priority priority) noexcept = 0;
  /// Tells of a type.
  /// @realtime set-up only
  /// @errors   as TypeCatalog::add()
  [[nodiscard]] virtual expected<void, std::string> add_type(const EventDescriptor& descriptor) = 0;

  /// Links the hub to the one at `target`, a URL or a name: from now on it asks that one for what
  /// its own consumers want, and nothing else, and hands it on to them. For both directions link
  /// both hubs. Returns at once; the link is there when the other hub is, through all its lives,
  /// and ends with this hub. Neither hub waits for the other. `node` must outlive the hub. Set-up
  /// only.
  /// @errors   more links than kLinkCountMax; a thread that can't be started. Source:
  ///           spec/events.md#ev-5
  [[nodiscard]] virtual expected<void, rpc::SetupError> link(rpc::Node& node,
                                                             const std::string& target,
                                                             const LinkConfig& config) = 0;
  /// How each link fares, in the order in which they were made.
  /// @realtime set-up only
  [[nodiscard]] virtual std::vector<LinkStatus> links() const = 0;

  /// Of an event, in bytes.
  [[nodiscard]] virtual std::uint32_t payload_size_max() const noexcept = 0;
  /// Over all suppliers.
  [[nodiscard]] virtual IntakeCounters intake() const noexcept = 0;
  [[nodiscard]] virtual std::size_t subscription_count() const noexcept = 0;
  /// Who went and why, of the last kDisconnectCountMax those whose number is above `after`, in
  /// order.
  /// @realtime set-up only
  [[nodiscard]] virtual std::vector<Disconnect> disconnects(std::uint64_t after = 0) const = 0;
  [[nodiscard]] virtual DisconnectCounters disconnect_counters() const noexcept = 0;

 protected:
  Hub() = default;
};

/// Limits of a server that fit a hub's: a stream for each subscription.
[[nodiscard]] rpc::ServerConfig server_config_for(const HubConfig& config);

}  // namespace rtpm::events
