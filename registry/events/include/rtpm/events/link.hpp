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

/// Hubs that are linked: one asks another for what its own consumers want, and hands it on to them.
/// @source   spec/events.md#ev-5
namespace rtpm::events {

/// No wish goes further, whatever hubs are linked in a ring.
/// @source   spec/events.md#ev-5.2-2
inline constexpr std::uint8_t kLinkHopsMax = 8;
inline constexpr std::size_t kLinkCountMax = 16;  ///< Of one hub.

/// How a hub is linked to another.
struct LinkConfig {
  std::string name = "link";  ///< Of its thread, "ev-<name>", and in the other hub's report.
  /// Of its thread, and at which the other hub sends to it. Events keep their suppliers' priority.
  Priority priority{};
  std::vector<int> cpus{};
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  /// Events that wait at the other hub at most; then the oldest are dropped, counted and told.
  std::uint32_t queue_capacity = kQueueCapacityMax;
  rpc::Transport transport = rpc::Transport::kAuto;
  bool shared_ring = true;                            ///< As ConsumerConfig::shared_ring.
  std::uint32_t miss_count_max = rpc::kMissCountMax;  ///< As ConsumerConfig::miss_count_max.
  Duration deadline = std::chrono::seconds{1};        ///< Of each try to reach the other hub.
  /// How often it looks whether the other hub is there, asks for its clock, and tries again.
  Duration attend_interval = std::chrono::milliseconds{250};
};

/// How a link stands.
enum class LinkState : std::uint8_t {
  kConnecting,   ///< The other hub was not reached yet. It tries on.
  kLinked,       ///< Events come.
  kInterrupted,  ///< It was linked, and the other hub is away. It tries on.
  kRefused,      ///< The other hub does not want it: the text says why. It tries on.
};
/// "connecting", "linked", "interrupted" or "refused".
[[nodiscard]] std::string_view to_string(LinkState state) noexcept;

/// A link, and what came over it. Counted since it was made, over all lives of the other hub.
struct LinkStatus {
  std::string target{};
  LinkState state = LinkState::kConnecting;
  std::string reason{};            ///< Why it is not linked; empty: it is.
  std::uint64_t peer_epoch = 0;    ///< The other hub's life; 0: not known yet.
  std::size_t interest_count = 0;  ///< Types and sources that the other hub is asked for.
  std::uint64_t taken_count = 0;
  /// Had come before, by another way, or had been pushed here.
  /// @source   spec/events.md#ev-5.3
  std::uint64_t repeated_count = 0;
  /// Over the hub's quota (HubConfig::quota, of each link), too large, no memory, or no event.
  std::uint64_t refused_count = 0;
  Losses losses{};  ///< On the way here, as the other hub told.
  std::uint64_t interruption_count = 0;
  Duration last_gap{0};  ///< How long the last interruption was: what came meanwhile is lost.
};

/// What an event of kLinkType tells: something became of a link, so that what comes over it may
/// have gaps. Consumers who want to know subscribe to it; it goes to no other hub.
struct LinkReport {
  LinkState state = LinkState::kConnecting;
  bool has_peer_restarted = false;  ///< It is another life of the other hub.
  Duration gap{0};                  ///< kLinked: how long it was interrupted, 0: the first time.
  std::uint64_t lost_count = 0;     ///< Since the link was made, but for interruptions.
  friend bool operator==(const LinkReport&, const LinkReport&) = default;
};
inline constexpr std::size_t kLinkReportSize = 24;
/// What the payload of an event of kLinkType says; nothing if it is none.
/// @realtime alloc-free
[[nodiscard]] std::optional<LinkReport> read_link_report(ConstBytes payload) noexcept;

}  // namespace rtpm::events
