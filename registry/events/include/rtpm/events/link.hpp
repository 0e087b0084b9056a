#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/events/delivery.hpp"
#include "rtpm/events/hub.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/thread.hpp"

/// Links between hubs: a hub subscribes to another one on behalf of its own consumers.
/// @source   spec/events.md#ev-5
namespace rtpm::events {

/// The most links over which interest is forwarded, however hubs are connected.
/// @source   spec/events.md#ev-5.2-2
inline constexpr std::uint8_t kLinkHopsMax = 8;
inline constexpr std::size_t kLinkCountMax = 16;  ///< Links per hub.

/// How a hub is linked to another.
struct LinkConfig {
  /// Names the thread of the link's consumer, "ev-<name>", and its entry in the other hub's report.
  std::string name = "link";
  /// The priority of that thread and of the other hub's sends. Events keep their supplier's
  /// priority.
  Priority priority{};
  std::vector<int> cpus{};
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  /// Queue capacity at the other hub. If full, the oldest events are dropped, counted and reported.
  std::uint32_t queue_capacity = kQueueCapacityMax;
  rpc::Transport transport = rpc::Transport::kAuto;
  bool shared_ring = true;                            ///< See ConsumerConfig::shared_ring.
  std::uint32_t miss_count_max = rpc::kMissCountMax;  ///< See ConsumerConfig::miss_count_max.
  Duration deadline = std::chrono::seconds{1};  ///< Bounds each attempt to reach the other hub.
  /// The interval at which the other hub is checked, its clock is read, and failures are retried.
  Duration attend_interval = std::chrono::milliseconds{250};
};

/// State of a link. All states except kLinked are retried.
enum class LinkState : std::uint8_t {
  kConnecting,   ///< The other hub has not been reached yet.
  kLinked,       ///< Events arrive.
  kInterrupted,  ///< It was linked; the other hub is unreachable.
  kRefused,      ///< The other hub refuses; LinkStatus::reason tells why.
};
/// "connecting", "linked", "interrupted" or "refused".
[[nodiscard]] std::string_view to_string(LinkState state) noexcept;

/// A link and its counters, since its creation and across restarts of the other hub.
struct LinkStatus {
  std::string target{};
  LinkState state = LinkState::kConnecting;
  std::string reason{};            ///< Why it is not linked; empty if it is.
  std::uint64_t peer_epoch = 0;    ///< Epoch of the other hub; 0 until known.
  std::size_t interest_count = 0;  ///< Types and sources requested from the other hub.
  std::uint64_t taken_count = 0;
  /// Duplicates: events that already arrived by another path, or were pushed to this hub.
  /// @source   spec/events.md#ev-5.3
  std::uint64_t repeated_count = 0;
  /// Events over the quota (HubConfig::quota, per link), too large, without memory, or malformed.
  std::uint64_t refused_count = 0;
  Losses losses{};  ///< Losses on the way here, as the other hub reports them.
  std::uint64_t interruption_count = 0;
  Duration last_gap{0};  ///< Length of the last interruption, whose events are lost.
};

/// The payload of a kLinkType event: the link changed state or lost events. Consumers subscribe
/// with `of_type(kLinkType)`; the event is not forwarded to other hubs.
struct LinkReport {
  LinkState state = LinkState::kConnecting;
  bool has_peer_restarted = false;  ///< The other hub has restarted.
  Duration gap{0};                  ///< kLinked: length of the interruption; 0 for the first link.
  std::uint64_t lost_count = 0;     ///< Since the link was created, not counting interruptions.
  friend bool operator==(const LinkReport&, const LinkReport&) = default;
};
inline constexpr std::size_t kLinkReportSize = 24;
/// Decodes the payload of a kLinkType event; nullopt if it is malformed.
/// @realtime alloc-free
[[nodiscard]] std::optional<LinkReport> read_link_report(ConstBytes payload) noexcept;

}  // namespace rtpm::events
