#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "event_types.hpp"
#include "node.hpp"
#include "rtpm/events/consumer.hpp"

namespace rtpm::python {

/// The events that a subscription gets, and how many may wait.
struct SubscriptionSettings {
  std::string hub{};
  std::string filter{};  ///< See FILTERS.md.
  std::uint32_t queue_capacity = 0;
  bool keeps_latest = false;
  events::DeliveryPolicy delivery{};  ///< But its queue, which follows from the above.
  Priority priority{};
  bool multicast = false;
  std::vector<std::unique_ptr<EventTypeOf>> types{};
};

/// Events that a program missed, by cause.
struct MissedEvents {
  events::Losses on_the_way{};     ///< Before they reached this program's queue.
  std::uint64_t queue_count = 0;   ///< The queue held as many events as it may.
  std::uint64_t memory_count = 0;  ///< The queue held as many bytes as it may.
  /// A newer event took their place (SubscriptionSettings::keeps_latest).
  std::uint64_t replaced_count = 0;
  [[nodiscard]] std::uint64_t total() const noexcept {
    return on_the_way.total() + queue_count + memory_count + replaced_count;
  }
};

/// An event that waits for Python.
struct WaitingEvent {
  events::EventHeader header{};
  MonotonicTime received{};
  std::vector<std::byte> payload{};
};

/// Copies a subscription's events into a bounded queue, so that its thread never needs the GIL.
/// @ownership keeps its node
/// @threads   on_events() and on_notice(): the consumer's; the others: any
class Subscription final : public events::EventHandler {
 public:
  /// @errors those of HubTypes::ask() and Consumer::create(); `filter_error` is set, and the result
  ///         null, if the filter's text is wrong
  [[nodiscard]] static expected<std::shared_ptr<Subscription>, SetupError> open(
      SharedNode node, SubscriptionSettings settings, std::string& filter_error);
  Subscription(SharedNode node, SubscriptionSettings settings);
  ~Subscription() override;

  /// Waits until an event, a notice or the end is there, or the time is over. Returns whether.
  bool wait(Duration span);
  /// The oldest delivery: an event, or the events of a conjunction; empty if there is none.
  [[nodiscard]] std::vector<WaitingEvent> take();
  /// The oldest single events of a type and schema whose payload has this size.
  [[nodiscard]] std::vector<WaitingEvent> take_alike(std::size_t count_max,
                                                     const events::EventHeader& header,
                                                     std::size_t payload_size);
  /// The oldest event's header and the size of its payload.
  [[nodiscard]] std::optional<std::pair<events::EventHeader, std::size_t>> peek() const;
  /// Texts for the log. While events are lost, one a second says how many; the others follow in
  /// the next one, or at once with `is_last`.
  [[nodiscard]] std::vector<std::string> take_notices(bool is_last = false);
  /// Whether there is more to do than to take events: there may be notices, or the end.
  [[nodiscard]] bool needs_attention() const noexcept { return needs_attention_; }
  /// Why no more events come; empty as long as they do.
  [[nodiscard]] std::string end_reason() const;
  [[nodiscard]] bool is_closed() const;
  /// The event's origin on this host's clock.
  [[nodiscard]] std::int64_t host_time_ns(const WaitingEvent& event) const;
  /// The bound of that time's error; events::kUncertaintyUnknown from a hub on another host.
  [[nodiscard]] std::uint32_t uncertainty_ns(const WaitingEvent& event) const;
  [[nodiscard]] MissedEvents missed() const;
  /// A descriptor that is readable while wait() would return at once.
  /// @errors -1, and errno is set
  [[nodiscard]] int file_descriptor();
  /// Unsubscribes. Waits for the consumer's thread, so call it without the GIL.
  void close();

  [[nodiscard]] const SharedNode& node() const noexcept { return node_; }
  [[nodiscard]] const std::string& hub() const noexcept { return settings_.hub; }

  void on_events(std::span<const events::EventView> events) override;
  void on_notice(const events::Notice& notice) override;

 private:
  void drop_oldest(std::uint64_t& count);
  void drop_like(const events::EventHeader& header);
  [[nodiscard]] WaitingEvent remove_front();
  [[nodiscard]] bool has_news() const noexcept;
  void signal() noexcept;
  void clear_signal() noexcept;

  SharedNode node_;
  SubscriptionSettings settings_;
  int process_;
  mutable std::mutex mutex_{};
  std::condition_variable changed_{};
  std::deque<WaitingEvent> waiting_{};
  std::size_t byte_count_ = 0;
  MissedEvents missed_{};
  std::uint64_t reported_loss_count_ = 0;
  MonotonicTime last_loss_report_{};
  std::deque<std::string> notices_{};
  std::string end_reason_{};
  bool is_closed_ = false;
  std::atomic<bool> needs_attention_{true};
  int event_descriptor_ = -1;
  mutable std::mutex consumer_mutex_{};
  std::unique_ptr<events::Consumer> consumer_{};
};

}  // namespace rtpm::python
