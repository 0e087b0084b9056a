#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "rtpm/asio/queue.hpp"
#include "rtpm/names/watch.hpp"

namespace rtpm::asio {
inline namespace RTPM_ASIO_FLAVOUR {

/// News of a watch of names: one of the fields is set. See names::WatchHandlers.
struct NameNews {
  std::optional<names::NameChange> change{};
  bool has_all = false;  ///< All bound names have been reported.
  std::optional<Duration> stale_for{};
  std::string notice{};  ///< The registry is away, or is there again; a sentence.
};

/// The changes of watched names in an Asio loop:
///
///     rtpm::asio::NameQueue names(loop);
///     auto watch = names::NameWatch::start(node, {}, {.interface = "lab.Arm"}, names.handlers());
///     …
///     const auto news = co_await names.async_next(net::use_awaitable);
///     if (news.change) …
///
/// NameWatch::start() waits for the registry; a loop that must not wait runs it by
/// Calls::async_set_up(). If a name changes several times before it is read, only its last change
/// is reported.
/// @ownership must outlive its watch; see Queue
/// @threads  those of Queue
class NameQueue {
 public:
  using executor_type = net::any_io_executor;

  /// @param where  an executor or an execution context
  template <class Where>
  explicit NameQueue(Where&& where) : queue_(std::forward<Where>(where), kLimits) {}
  NameQueue(const NameQueue&) = delete;
  NameQueue& operator=(const NameQueue&) = delete;

  [[nodiscard]] executor_type get_executor() const noexcept { return queue_.get_executor(); }
  /// Waits for the oldest news; one wait at a time.
  /// @return   void(error_code, NameNews)
  /// @errors   operation_aborted
  template <class Token>
  auto async_next(Token&& token) {
    return queue_.async_next(std::forward<Token>(token));
  }
  /// Ends a wait with operation_aborted.
  void cancel() { queue_.cancel(); }
  /// How many news were dropped because the queue was full.
  [[nodiscard]] std::uint64_t dropped_count() const { return queue_.dropped_count(); }

  /// The handlers for NameWatch::start().
  [[nodiscard]] names::WatchHandlers handlers() {
    return {.on_change =
                [this](const names::NameChange& change) {
                  queue_.replace({.change = change}, sizeof change, [&](const NameNews& news) {
                    return news.change && news.change->entry.name == change.entry.name;
                  });
                },
            .on_state = [this] { queue_.push({.has_all = true}); },
            .on_stale =
                [this](Duration stale_for) {
                  queue_.replace({.stale_for = stale_for}, 0,
                                 [](const NameNews& news) { return news.stale_for.has_value(); });
                },
            .on_notice =
                [this](std::string_view sentence) {
                  queue_.push({.notice = std::string(sentence)}, sentence.size());
                }};
  }

 private:
  /// More names than a registry has.
  static constexpr QueueLimits kLimits{.count_max = std::size_t{1} << 14};
  Queue<NameNews> queue_;
};

}  // namespace RTPM_ASIO_FLAVOUR
}  // namespace rtpm::asio
