#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/async.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::transport {
class MergedDescriptor;
}  // namespace rtpm::transport

namespace rtpm::rpc {

/// Identifies a call of a Completions.
using CallNumber = std::uint64_t;

/// Calls and streams in flight, with callbacks that the polling thread runs:
///
///     completions.then(arm.begin_get_pose(), [&](const auto& pose) { show(pose); });
///     while (is_running) completions.wait(next_frame);
///
/// The callback gets the result of take(): the reply or the error, including a failure to start the
/// call. It runs once, in poll(), wait() or the destructor, and may add and cancel calls.
///
/// An event loop of another kind watches descriptor() instead, and calls poll() when it is
/// readable. While nothing happens, no call is polled, neither there nor in wait().
/// @ownership holds the calls and callbacks; refers to the calls' bindings, which must outlive it.
///            Destruction cancels open calls: their callbacks get kCancelled
/// @threads  one at a time
/// @realtime adding allocates; waiting is alloc-free except for the callbacks
class Completions {
 public:
  Completions() noexcept;
  Completions(const Completions&) = delete;
  Completions& operator=(const Completions&) = delete;
  ~Completions();

  /// Adds the result of a generated begin_x() and the callback for when the call ends.
  /// @errors   the callback gets kNoResources if no descriptor is left to wait with
  template <class Pending, class Callback>
  CallNumber then(expected<Pending, CallError> begun, Callback callback) {
    return add(std::make_unique<Call<Pending, Callback>>(std::move(begun), std::move(callback)));
  }
  /// Adds a stream. `on_item` gets each item, valid until it returns. `on_end` runs once, with an
  /// expected<void, CallError>: an error, unless the server finished the stream.
  /// @errors   as then()
  template <class Stream, class OnItem, class OnEnd>
  CallNumber then_each(expected<Stream, CallError> begun, OnItem on_item, OnEnd on_end) {
    return add(std::make_unique<Items<Stream, OnItem, OnEnd>>(std::move(begun), std::move(on_item),
                                                              std::move(on_end)));
  }
  /// Adds the wait for one item of a stream that the caller keeps. `callback` gets the result of
  /// next() once: an item, none at the end of the stream, or an error. Until then, only this object
  /// uses the stream. cancel() ends the wait and leaves the stream open.
  /// @ownership refers to the stream, which must outlive the wait
  /// @errors   as then()
  template <class Stream, class Callback>
  CallNumber then_next(Stream& stream, Callback callback) {
    return add(std::make_unique<Next<Stream, Callback>>(stream, std::move(callback)));
  }
  /// Cancels a call or stream, and notifies the server; see PendingReply::cancel(). Its callback
  /// gets kCancelled in the next poll(). Does nothing if it has ended.
  void cancel(CallNumber number);
  /// Cancels all calls, streams and waits, also those that a callback adds meanwhile. Each callback
  /// gets kCancelled before this returns.
  void cancel_all();

  /// Runs the callbacks of finished calls and received items, and returns how many it ran. Also
  /// resends lost frames, so call it when descriptor() is readable.
  /// @realtime two syscalls, and for each call with something to do at most six and one per
  ///           received frame
  std::size_t poll();
  /// Waits until there is a callback to run, at most until `until`, and does what poll() does.
  /// Returns at once if no call is open.
  std::size_t wait(MonotonicTime until);
  /// The one descriptor to watch for all calls, such as by poll(2), epoll, Asio, Qt or asyncio:
  /// readable while poll() has something to do (level-triggered). A call that is added or cancelled
  /// counts, too. It stays the same as long as this object lives, which closes it; do not read it.
  /// @realtime the first time set-up only
  /// @errors   no descriptor left
  [[nodiscard]] expected<int, SetupError> descriptor();
  /// Calls whose callback, and streams whose `on_end`, has not run yet.
  [[nodiscard]] std::size_t open_count() const noexcept { return open_.size(); }

 private:
  friend class CompletionThread;

  class Entry {
   public:
    Entry() = default;
    Entry(const Entry&) = delete;
    Entry& operator=(const Entry&) = delete;
    virtual ~Entry() = default;
    /// Returns what to wait for before the first step(): nothing.
    [[nodiscard]] virtual Readiness begin() { return {.is_ready = false}; }
    /// Takes what has arrived, runs the callback for items, and returns what to wait for.
    [[nodiscard]] virtual Readiness step() = 0;
    /// Runs the callback for the end.
    virtual void complete() = 0;
    void end(CallError error) noexcept {
      if (!error_) error_ = error;
    }

   protected:
    std::optional<CallError> error_{};  ///< Why it ended without a result.
    std::size_t item_count_ = 0;

   private:
    friend class Completions;
    CallNumber number_ = 0;
    int descriptor_ = -1;      ///< Watched, if not negative.
    MonotonicTime due_{};      ///< When step() is due, unless the descriptor reports something.
    bool is_in_step_ = false;  ///< It runs a callback, which may poll.
  };

  template <class Pending, class Callback>
  class Call final : public Entry {
   public:
    Call(expected<Pending, CallError> begun, Callback callback)
        : begun_(std::move(begun)), callback_(std::move(callback)) {
      if (!begun_) end(begun_.error());
    }
    [[nodiscard]] Readiness begin() override { return step(); }
    [[nodiscard]] Readiness step() override { return error_ ? Readiness{} : begun_->readiness(); }
    void complete() override {
      if (error_) {
        callback_(typename Pending::Result{unexpected{*error_}});
      } else {
        callback_(begun_->take());
      }
    }

   private:
    expected<Pending, CallError> begun_;
    Callback callback_;
  };

  template <class Stream, class OnItem, class OnEnd>
  class Items final : public Entry {
   public:
    Items(expected<Stream, CallError> begun, OnItem on_item, OnEnd on_end)
        : begun_(std::move(begun)), on_item_(std::move(on_item)), on_end_(std::move(on_end)) {
      if (!begun_) end(begun_.error());
    }
    [[nodiscard]] Readiness step() override {
      // Other calls have their turn after that many.
      constexpr int kItemCountMax = 32;
      for (int i = 0; i < kItemCountMax && !error_; ++i) {
        const auto item = begun_->next(MonotonicTime{});
        if (!item) {
          if (item.error() == CallError::kTimeout && begun_->is_open()) return begun_->readiness();
          end(item.error());
        } else if (!*item) {
          return {};
        } else {
          ++item_count_;
          on_item_(**item);
        }
      }
      return {.is_ready = error_.has_value()};
    }
    void complete() override {
      on_end_(error_ ? expected<void, CallError>{unexpected{*error_}}
                     : expected<void, CallError>{});
    }

   private:
    expected<Stream, CallError> begun_;
    OnItem on_item_;
    OnEnd on_end_;
  };

  template <class Stream, class Callback>
  class Next final : public Entry {
   public:
    Next(Stream& stream, Callback callback) : stream_(stream), callback_(std::move(callback)) {}
    [[nodiscard]] Readiness begin() override { return step(); }
    [[nodiscard]] Readiness step() override {
      if (error_ || result_) return {};
      auto item = stream_.next(MonotonicTime{});
      if (!item && item.error() == CallError::kTimeout && stream_.is_open()) {
        return stream_.readiness();
      }
      result_.emplace(std::move(item));
      return {};
    }
    void complete() override {
      // An item that was taken must not get lost.
      callback_(result_ ? std::move(*result_) : Result{unexpected{*error_}});
    }

   private:
    using Result = decltype(std::declval<Stream&>().next(MonotonicTime{}));
    Stream& stream_;
    Callback callback_;
    std::optional<Result> result_{};
  };

  CallNumber add(std::unique_ptr<Entry> entry);
  [[nodiscard]] std::size_t step(Entry& entry);
  void watch(Entry& entry, const Readiness& next) noexcept;
  void complete(Entry& entry);
  void set_alarm() noexcept;
  /// The first entry from `number` on.
  [[nodiscard]] std::vector<std::unique_ptr<Entry>>::iterator find_from(CallNumber number) noexcept;
  [[nodiscard]] Entry* find(CallNumber number) noexcept;

  std::vector<std::unique_ptr<Entry>> open_{};  ///< By number, so in the order of adding.
  CallNumber next_number_ = 1;
  std::unique_ptr<transport::MergedDescriptor> merged_;  ///< Null until it is first needed.
  MonotonicTime alarm_ = kNever;                         ///< The time for which `merged_` is set.
};

/// Completions with a thread that waits and runs the callbacks:
///
///     auto thread = rpc::CompletionThread::start({.name = "replies"}).value();
///     thread->then(arm.begin_get_pose(), [](const auto& pose) { … });
///
/// Callbacks run one at a time on that thread and must return quickly, since other callbacks wait
/// for them. They may add calls. Real-time class: set-up. A loop that counts microseconds should
/// hold the PendingReply itself and wait for it.
/// @ownership like Completions; destruction cancels open calls and joins the thread
/// @threads  then() and then_each() from any
class CompletionThread {
 public:
  /// Starts the thread. Without a priority in `config` the thread is time-shared.
  /// @realtime set-up only
  /// @errors   those of rt::Thread::start(); no descriptor left
  [[nodiscard]] static expected<std::unique_ptr<CompletionThread>, SetupError> start(
      const rt::ThreadConfig& config);
  CompletionThread(const CompletionThread&) = delete;
  CompletionThread& operator=(const CompletionThread&) = delete;
  ~CompletionThread();

  /// Does the same as Completions::then(), but the callback runs on this object's thread.
  template <class Pending, class Callback>
  void then(expected<Pending, CallError> begun, Callback callback) {
    add(std::make_unique<Completions::Call<Pending, Callback>>(std::move(begun),
                                                               std::move(callback)));
  }
  /// Does the same as Completions::then_each(), but the callbacks run on this object's thread.
  template <class Stream, class OnItem, class OnEnd>
  void then_each(expected<Stream, CallError> begun, OnItem on_item, OnEnd on_end) {
    add(std::make_unique<Completions::Items<Stream, OnItem, OnEnd>>(
        std::move(begun), std::move(on_item), std::move(on_end)));
  }

 private:
  class Impl;
  explicit CompletionThread(std::unique_ptr<Impl> impl) noexcept;
  void add(std::unique_ptr<Completions::Entry> entry);
  std::unique_ptr<Impl> impl_;
};

/// Makes `text` this thread's refusal_text(): for event loops that pass the error of a call on to
/// another thread than the one that polled.
/// @realtime alloc-free
void set_refusal_text(std::string_view text) noexcept;

}  // namespace rtpm::rpc
