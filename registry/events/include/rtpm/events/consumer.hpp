#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
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

/// What a consumer is told besides events.
enum class NoticeKind : std::uint8_t {
  kSubscribed,    ///< Events come from now on.
  kLosses,        ///< Some were lost; Notice::losses says how many of each cause in all.
  kInterrupted,   ///< The hub is gone, or dropped the subscription; the text says why. It tries on.
  kResubscribed,  ///< It is back; what came in Notice::gap is lost.
  kEnded,         ///< The subscription has ended and stays so: unsubscribed, or refused anew.
  kHandlerFailed,  ///< on_events() threw; the event counts as taken.
};

struct Notice {
  NoticeKind kind = NoticeKind::kSubscribed;
  std::string_view text{};  ///< For people; valid during the call.
  Losses losses{};          ///< Since create(), over all lives of the hub.
  Duration gap{0};          ///< kResubscribed: since the hub was last heard.
  bool has_hub_restarted = false;
  std::uint64_t hub_epoch = 0;  ///< The life of the hub that was heard last.
};

/// What a program does with events. All is called one at a time: from the consumer's own thread or,
/// where ConsumerConfig::has_own_thread is false, from one of the same priority and CPUs that
/// serves several consumers. It may unsubscribe its consumer, change or suspend it; it may throw,
/// which is counted and told. It must not destroy its consumer.
class EventHandler {
 public:
  virtual ~EventHandler() = default;
  /// One delivery: an event, or the events of a conjunction in the order of the filter's children.
  /// Valid during the call; payloads are aligned to 16 bytes.
  virtual void on_events(std::span<const EventView> events) = 0;
  virtual void on_notice(const Notice& notice) { static_cast<void>(notice); }
};

/// How a consumer is set up.
struct ConsumerConfig {
  std::string name = "consumer";  ///< Of its thread, "ev-<name>", and in the hub's report.
  Filter filter{};
  DeliveryPolicy delivery{};
  Priority priority{};  ///< Of its thread, and at which the hub sends to it.
  std::vector<int> cpus{};
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  /// The types whose fields it filters by. Constants of static life.
  std::vector<const EventDescriptor*> types{};
  rpc::Transport transport = rpc::Transport::kAuto;
  /// On the hub's own host, reads the ring that the hub writes once for all, instead of taking a
  /// stream of its own.
  bool shared_ring = true;
  /// Its handler is called by its own thread always. Else, where two or more consumers of a node
  /// read one ring at the same priority, CPUs and real-time mode, and do not spin while they wait,
  /// one thread calls all their handlers, which spares a change of threads for each but one; so it
  /// is where they receive one multicast, which then comes by one socket, and for a single one. A
  /// handler keeps the others waiting 0.1 ms, where events come without a pause 1 ms: then each
  /// consumer's own thread serves it until that handler returns, and the slow one's own thread
  /// until it was quick for 1 s, or 10 s if that happens often. Handlers that compute in parallel
  /// set it.
  bool has_own_thread = false;
  /// Where it does not read the ring: receives the hub's multicast, if the hub has one, at the
  /// interface with this address (empty: as the system's routes say). With has_own_thread by a
  /// socket of its own.
  bool multicast = false;
  std::string multicast_interface{};
  /// How many signs of life in a row the hub may miss, one each half second, until it drops the
  /// subscription: rpc::kMissCountMin…kMissCountMax. A handler that takes longer than that is a
  /// reason, too. As many of the hub's the consumer may miss until it takes the hub for gone.
  std::uint32_t miss_count_max = rpc::kMissCountMax;
  /// The epoch of the hub that hands on what comes; 0: it is no hub's. A hub's link sets it.
  std::uint64_t linking_hub = 0;
  Duration deadline = std::chrono::seconds{1};  ///< Of create(), and of each try to come back.
};

/// What a consumer got.
struct ConsumerCounters {
  std::uint64_t event_count = 0;
  std::uint64_t delivery_count = 0;
  std::uint64_t handler_failure_count = 0;
  std::uint64_t resubscription_count = 0;
  std::uint64_t broken_count = 0;  ///< Items that were none.
  Losses losses{};
};

/// Subscribes at a hub and hands what comes to a handler, on a thread of its own. When the hub
/// restarts, or the way to it is lost, it subscribes again by itself and tells the gap.
/// @ownership refers to its node and handler, which must outlive it
/// @threads  any
class Consumer {
 public:
  /// Subscribes at the hub at `target`, a URL or a name.
  /// @realtime set-up only
  /// @errors   no hub there; the filter or policy is refused (the text names the node and the
  ///           field); a right that the process lacks
  [[nodiscard]] static expected<std::unique_ptr<Consumer>, rpc::SetupError> create(
      rpc::Node& node, const std::string& target, ConsumerConfig config, EventHandler& handler);
  Consumer(const Consumer&) = delete;
  Consumer& operator=(const Consumer&) = delete;
  /// Unsubscribes, and waits until the handler has returned.
  ~Consumer();

  /// Puts another filter and policy in the place of the present ones, losing no event: each is
  /// judged by the one or the other.
  /// @realtime set-up only
  /// @errors   as create(); then nothing is changed
  [[nodiscard]] expected<void, rpc::SetupError> change(const Filter& filter,
                                                       const DeliveryPolicy& delivery);
  /// From now on nothing comes, and what is missed is counted, until resume().
  /// @realtime set-up only
  [[nodiscard]] expected<void, rpc::CallError> suspend();
  [[nodiscard]] expected<void, rpc::CallError> resume();
  /// Ends the subscription. From the handler it returns at once, and the thread ends after the
  /// handler; from elsewhere it waits for that. May be called again.
  void unsubscribe();

  [[nodiscard]] bool is_subscribed() const noexcept;
  /// Whether it reads the hub's ring, or receives its multicast.
  [[nodiscard]] bool reads_ring() const noexcept;
  [[nodiscard]] bool receives_multicast() const noexcept;
  [[nodiscard]] ConsumerCounters counters() const;

 private:
  class Impl;
  explicit Consumer(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::events
