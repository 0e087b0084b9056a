#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/asio/queue.hpp"
#include "rtpm/events/consumer.hpp"

namespace rtpm::asio {
inline namespace RTPM_ASIO_FLAVOUR {

/// A received event.
struct Event {
  events::EventHeader header{};
  std::vector<std::byte> payload{};  ///< Aligned to 16 bytes.
};

/// A notice of a consumer.
struct EventNotice {
  events::Notice notice{};  ///< Its text is `text`.
  std::string text{};
};

/// A delivery of a subscription, or a notice.
struct EventNews {
  /// An event, or the events of a conjunction in the order of the filter's children; none with a
  /// notice.
  std::vector<Event> events{};
  std::optional<EventNotice> notice{};
};

/// The events and notices of a consumer in an Asio loop:
///
///     rtpm::asio::EventQueue arrivals(loop);
///     auto consumer = events::Consumer::create(node, hub, {.filter = …}, arrivals);
///     …
///     const auto news = co_await arrivals.async_next(net::use_awaitable);
///     for (const rtpm::asio::Event& event : news.events) show(event);
///
/// Consumer::create() waits for the hub; a loop that must not wait runs it by
/// Calls::async_set_up(). For events of one generated type, see Queue. Events are copied on the
/// consumer's thread. A full queue drops the oldest, which dropped_count() counts, beside the
/// consumer's own losses. After the notice kEnded, async_next() reports eof.
/// @ownership must outlive its consumer; see Queue
/// @threads  those of Queue
class EventQueue final : public events::EventHandler {
 public:
  using executor_type = net::any_io_executor;

  /// @param where  an executor or an execution context
  template <class Where>
  explicit EventQueue(Where&& where, QueueLimits limits = {})
      : queue_(std::forward<Where>(where), limits) {}

  [[nodiscard]] executor_type get_executor() const noexcept { return queue_.get_executor(); }
  /// Waits for the oldest news; one wait at a time.
  /// @return   void(error_code, EventNews)
  /// @errors   eof: the subscription has ended for good · operation_aborted
  template <class Token>
  auto async_next(Token&& token) {
    return queue_.async_next(std::forward<Token>(token));
  }
  /// Ends a wait with operation_aborted.
  void cancel() { queue_.cancel(); }
  /// How many deliveries and notices were dropped because the queue was full.
  [[nodiscard]] std::uint64_t dropped_count() const { return queue_.dropped_count(); }

  void on_events(std::span<const events::EventView> events) override {
    EventNews news;
    std::size_t byte_count = 0;
    news.events.reserve(events.size());
    for (const events::EventView& event : events) {
      news.events.push_back({event.header, {event.payload.begin(), event.payload.end()}});
      byte_count += event.payload.size();
    }
    queue_.push(std::move(news), byte_count);
  }
  void on_notice(const events::Notice& notice) override {
    EventNews news{.notice = EventNotice{notice, std::string(notice.text)}};
    news.notice->notice.text = {};
    queue_.push(std::move(news), 0);
    if (notice.kind == events::NoticeKind::kEnded) queue_.close();
  }

 private:
  Queue<EventNews> queue_;
};

}  // namespace RTPM_ASIO_FLAVOUR
}  // namespace rtpm::asio
