#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <utility>

#include "rtpm/asio/net.hpp"
#include "rtpm/asio/operation.hpp"
#include "rtpm/base/assert.hpp"

namespace rtpm::asio {
inline namespace RTPM_ASIO_FLAVOUR {

/// How much a Queue holds.
struct QueueLimits {
  std::size_t count_max = 1024;                  ///< At least 1.
  std::size_t byte_max = std::size_t{16} << 20;  ///< All values together.
};

namespace detail {

template <class T>
class QueueState final : public Part, public std::enable_shared_from_this<QueueState<T>> {
 public:
  QueueState(net::any_io_executor io, QueueLimits limits) : io_(std::move(io)), limits_(limits) {}

  [[nodiscard]] const net::any_io_executor& executor() const noexcept { return io_; }

  /// Replaces the first waiting value that `is_same(value)`, if any, or appends.
  template <class IsSame>
  void put(T value, std::size_t byte_count, IsSame is_same) {
    const std::lock_guard lock(mutex_);
    if (is_closed_) return;
    if (wait_) {
      Wait::post(std::move(wait_), ErrorCode{}, std::move(value));
      return;
    }
    const auto same = std::ranges::find_if(
        values_, [&](const Waiting& waiting) { return is_same(waiting.value); });
    if (same != values_.end()) {
      byte_count_ += byte_count - same->byte_count;
      *same = {std::move(value), byte_count};
      return;
    }
    while (!values_.empty() &&
           (values_.size() >= limits_.count_max || byte_count_ + byte_count > limits_.byte_max)) {
      static_cast<void>(take());
      ++dropped_count_;
    }
    byte_count_ += byte_count;
    values_.push_back({std::move(value), byte_count});
  }
  void close() {
    const std::lock_guard lock(mutex_);
    is_closed_ = true;
    end_wait(net::error::eof);
  }
  void cancel() {
    const std::lock_guard lock(mutex_);
    end_wait(net::error::operation_aborted);
  }
  [[nodiscard]] std::uint64_t dropped_count() const {
    const std::lock_guard lock(mutex_);
    return dropped_count_;
  }

  using Wait = Operation<ErrorCode, T>;
  template <class Slot>
  void start(std::unique_ptr<Wait> wait, const Slot& slot) {
    const std::lock_guard lock(mutex_);
    if (is_shut_down_) return;
    RTPM_ASSERT(!wait_, "one async_next() at a time");
    if (!values_.empty()) {
      Wait::post(std::move(wait), ErrorCode{}, take());
    } else if (is_closed_) {
      Wait::end(std::move(wait), net::error::eof);
    } else {
      wait_ = std::move(wait);
      connect(slot, kEndsWait, [state = this->weak_from_this(), number = ++wait_count_] {
        if (const auto self = state.lock()) self->cancel(number);
      });
    }
  }
  void shut_down() noexcept override {
    std::unique_ptr<Wait> dropped;
    const std::lock_guard lock(mutex_);
    is_closed_ = is_shut_down_ = true;
    dropped = std::move(wait_);
  }

 private:
  struct Waiting {
    T value;
    std::size_t byte_count;
  };

  void end_wait(const ErrorCode& error) {
    if (wait_) Wait::end(std::move(wait_), error);
  }
  void cancel(std::uint64_t number) {
    const std::lock_guard lock(mutex_);
    if (number == wait_count_) end_wait(net::error::operation_aborted);
  }
  [[nodiscard]] T take() {
    T value = std::move(values_.front().value);
    byte_count_ -= values_.front().byte_count;
    values_.pop_front();
    return value;
  }

  net::any_io_executor io_;
  QueueLimits limits_;
  mutable std::mutex mutex_{};
  std::deque<Waiting> values_{};
  std::size_t byte_count_ = 0;
  std::uint64_t dropped_count_ = 0;
  std::unique_ptr<Wait> wait_{};
  std::uint64_t wait_count_ = 0;
  bool is_closed_ = false;
  bool is_shut_down_ = false;
};

}  // namespace detail

/// Values that callbacks on RTPM's threads put in, and an Asio loop awaits:
///
///     rtpm::asio::Queue<lab::Touched> touches(loop);
///     auto consumer = lab::TouchedConsumer::create(
///         node, hub, [&](const lab::Touched& touch, const auto&) { touches.push(touch); });
///     …
///     const auto touch = co_await touches.async_next(net::use_awaitable);
///
/// A full queue drops its oldest value.
/// @param T  movable, with a default value
/// @ownership destruction ends a wait with operation_aborted; destroy the callbacks that push
///            before. If the io_context is destroyed, the waiting handler is destroyed without being
///            run
/// @threads  push(), close(), dropped_count(): any; the rest: one at a time; the io_context may run
///           on several threads
/// @realtime set-up only: takes a lock and allocates
template <class T>
class Queue {
 public:
  using executor_type = net::any_io_executor;

  explicit Queue(const executor_type& executor, QueueLimits limits = {})
      : state_(detail::make_part<detail::QueueState<T>>(executor, limits)) {}
  template <class Context>
  requires std::convertible_to<Context&, net::execution_context&>
  explicit Queue(Context& context, QueueLimits limits = {})
      : Queue(executor_type(context.get_executor()), limits) {}
  Queue(const Queue&) = delete;
  Queue& operator=(const Queue&) = delete;
  ~Queue() { state_->cancel(); }

  [[nodiscard]] executor_type get_executor() const noexcept { return state_->executor(); }

  /// @param byte_count  its share of QueueLimits::byte_max
  void push(T value, std::size_t byte_count = sizeof(T)) {
    state_->put(std::move(value), byte_count, [](const T&) { return false; });
  }
  /// Replaces the waiting value that `is_same(value)` is true of, or pushes.
  template <class IsSame>
  void replace(T value, std::size_t byte_count, IsSame is_same) {
    state_->put(std::move(value), byte_count, std::move(is_same));
  }
  /// Ends the queue: async_next() reports eof once it is empty, and later values are ignored.
  void close() { state_->close(); }
  /// Ends a wait with operation_aborted.
  void cancel() { state_->cancel(); }
  /// How many values were dropped because the queue was full.
  [[nodiscard]] std::uint64_t dropped_count() const { return state_->dropped_count(); }

  /// Waits for the oldest value; one wait at a time. Cancelling it loses no value.
  /// @return   void(error_code, T)
  /// @errors   eof: the queue was closed · operation_aborted
  template <class Token>
  auto async_next(Token&& token) {
    return net::async_initiate<Token, void(ErrorCode, T)>(
        [state = state_](auto handler) {
          const auto slot = detail::slot_of(handler);
          state->start(detail::make_operation<ErrorCode, T>(std::move(handler), state->executor()),
                       slot);
        },
        token);
  }

 private:
  std::shared_ptr<detail::QueueState<T>> state_;
};

}  // namespace RTPM_ASIO_FLAVOUR
}  // namespace rtpm::asio
