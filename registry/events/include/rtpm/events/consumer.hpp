#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/events/delivery.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/events/filter.hpp"
#include "rtpm/events/scalar.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::events {

/// The kinds of notices that a consumer reports besides events.
enum class NoticeKind : std::uint8_t {
  kSubscribed,   ///< Events arrive from now on.
  kLosses,       ///< Events were lost; Notice::losses has the totals by cause.
  kInterrupted,  ///< The hub or the subscription is gone; the text tells why. The consumer retries.
  kResubscribed,   ///< Subscribed again; the events of Notice::gap are lost.
  kEnded,          ///< The subscription ended for good: unsubscribed, or refused again.
  kHandlerFailed,  ///< on_events() threw; the event counts as delivered.
};

struct Notice {
  NoticeKind kind = NoticeKind::kSubscribed;
  std::string_view text{};  ///< Text for users; valid during the call.
  Losses losses{};          ///< Since create(), across restarts of the hub.
  Duration gap{0};          ///< kResubscribed: time since the last message from the hub.
  bool has_hub_restarted = false;
  std::uint64_t hub_epoch = 0;  ///< Epoch of the latest hub.
};

/// Receives events. A call may unsubscribe, change or suspend its consumer, but not destroy it.
/// Exceptions are counted and reported as kHandlerFailed.
/// @threads  one call at a time: on the consumer's own thread or, without
///           ConsumerConfig::has_own_thread, on a thread that serves several consumers with the
///           same priority and CPUs
class EventHandler {
 public:
  virtual ~EventHandler() = default;
  /// One delivery: an event, or the events of a conjunction in the order of the filter's children.
  /// Valid during the call; payloads are aligned to 16 bytes.
  virtual void on_events(std::span<const EventView> events) = 0;
  virtual void on_notice(const Notice& notice) { static_cast<void>(notice); }
};

/// Configures a consumer.
struct ConsumerConfig {
  /// Names the consumer's thread, "ev-<name>", and its entry in the hub's report.
  std::string name = "consumer";
  Filter filter{};
  DeliveryPolicy delivery{};
  Priority priority{};  ///< The priority of its thread, and of the hub's sends to it.
  std::vector<int> cpus{};
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  /// The types whose fields the filter compares; constants with static lifetime.
  std::vector<const EventDescriptor*> types{};
  rpc::Transport transport = rpc::Transport::kAuto;
  /// On the hub's host: reads the ring that the hub writes once for all consumers, instead of a
  /// separate stream.
  bool shared_ring = true;
  /// Only the consumer's own thread calls its handler; for handlers that compute in parallel. By
  /// default one thread calls the handlers of all consumers of a node that read the same ring or
  /// multicast with equal priority, CPUs and real-time mode, and do not spin. If a handler takes
  /// longer than 0.1 ms (1 ms under continuous load), the other consumers move to their own threads
  /// until it returns, and its consumer for another 1 s to 10 s.
  bool has_own_thread = false;
  /// If it does not read the ring: receives the hub's multicast, if any, through the interface with
  /// the address `multicast_interface` (if empty, the routing table chooses). With has_own_thread
  /// it uses its own socket.
  bool multicast = false;
  std::string multicast_interface{};
  /// After this many consecutive lost heartbeats, one per half second, the hub drops the
  /// subscription and the consumer considers the hub gone: rpc::kMissCountMin…kMissCountMax. A
  /// handler that runs for longer has the same effect.
  std::uint32_t miss_count_max = rpc::kMissCountMax;
  /// The epoch of the hub that forwards these events; 0 if none. Set only by a hub's link.
  std::uint64_t linking_hub = 0;
  /// Bounds create() and each attempt to resubscribe.
  Duration deadline = std::chrono::seconds{1};
};

/// Counters of received events.
struct ConsumerCounters {
  std::uint64_t event_count = 0;
  std::uint64_t delivery_count = 0;
  std::uint64_t handler_failure_count = 0;
  std::uint64_t resubscription_count = 0;
  std::uint64_t broken_count = 0;  ///< Malformed items.
  Losses losses{};
};

/// Subscribes to a hub and passes events to a handler. When the hub restarts or the connection is
/// lost, it resubscribes automatically and reports the gap.
/// @ownership refers to its node and handler, which must outlive it
/// @threads  any
class Consumer {
 public:
  /// Subscribes to the hub at `target`, a URL or a name.
  /// @realtime set-up only
  /// @errors   no hub answers; the hub refuses the filter or policy (the text names node and
  ///           field); missing real-time rights
  [[nodiscard]] static expected<std::unique_ptr<Consumer>, SetupError> create(
      rpc::Node& node, const std::string& target, ConsumerConfig config, EventHandler& handler);
  Consumer(const Consumer&) = delete;
  Consumer& operator=(const Consumer&) = delete;
  /// Unsubscribes, and waits until the handler has returned.
  ~Consumer();

  /// Replaces filter and policy without losing an event: each event is judged by either the old or
  /// the new ones.
  /// @realtime set-up only
  /// @errors   those of create(); nothing has changed then
  [[nodiscard]] expected<void, SetupError> change(const Filter& filter,
                                                  const DeliveryPolicy& delivery);
  /// Stops delivery until resume(); missed events are counted.
  /// @realtime set-up only
  [[nodiscard]] expected<void, rpc::CallError> suspend();
  [[nodiscard]] expected<void, rpc::CallError> resume();
  /// Ends the subscription. Waits for the handler, except when called from it. May be called again.
  void unsubscribe();

  [[nodiscard]] bool is_subscribed() const noexcept;
  /// Whether events arrive through the ring or the multicast; if neither, through the stream.
  [[nodiscard]] bool reads_ring() const noexcept;
  [[nodiscard]] bool receives_multicast() const noexcept;
  [[nodiscard]] ConsumerCounters counters() const;

 private:
  class Impl;
  explicit Consumer(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::events
