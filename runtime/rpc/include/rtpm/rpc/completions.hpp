#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::rpc {

/// Calls that were begun, and callbacks for their ends, run by the thread that polls:
///
///     completions.then(arm.begin_get_pose(), [&](const auto& pose) { show(pose); });
///     while (is_running) completions.wait(next_frame);
///
/// The callback gets the result of take(): the reply or the error, also the failure to begin the
/// call. It runs once, in poll(), wait() or the end of this, and may add more calls.
/// Each open call holds a call channel, so NodeConfig::channel_count_max is the limit.
/// @ownership holds the calls and callbacks; refers to the bindings of the calls, which must
///           outlive it. Its end cancels what is open: the callbacks get kCancelled
/// @threads  one at a time
/// @realtime adding allocates; waiting is alloc-free but for what callbacks do
class Completions {
 public:
  Completions() noexcept = default;
  Completions(const Completions&) = delete;
  Completions& operator=(const Completions&) = delete;
  ~Completions();

  /// Adds the result of a generated begin_x(), and the callback for the call's end.
  template <class Pending, class Callback>
  void then(expected<Pending, CallError> begun, Callback callback) {
    add(std::make_unique<Call<Pending, Callback>>(std::move(begun), std::move(callback)));
  }

  /// Polls each call once, runs the callbacks of those that ended, and returns how many ended. It
  /// also repeats lost frames, so call it now and then.
  /// @realtime at most two syscalls a call
  std::size_t poll();
  /// Waits until a call has ended, but not beyond `until`, runs the callbacks and returns how many
  /// ended. With several open calls it polls each once a millisecond. Returns at once if none is
  /// open.
  std::size_t wait(MonotonicTime until);
  /// Calls whose callback has not run yet.
  [[nodiscard]] std::size_t open_count() const noexcept { return open_.size(); }

 private:
  friend class CompletionThread;

  class Entry {
   public:
    Entry() = default;
    Entry(const Entry&) = delete;
    Entry& operator=(const Entry&) = delete;
    virtual ~Entry() = default;
    [[nodiscard]] virtual bool wait(MonotonicTime until) noexcept = 0;
    virtual void cancel() noexcept = 0;
    virtual void complete() = 0;
  };

  template <class Pending, class Callback>
  class Call final : public Entry {
   public:
    Call(expected<Pending, CallError> begun, Callback callback)
        : begun_(std::move(begun)), callback_(std::move(callback)) {}
    [[nodiscard]] bool wait(MonotonicTime until) noexcept override {
      return !begun_ || begun_->wait(until);
    }
    void cancel() noexcept override {
      if (begun_) begun_->cancel();
    }
    void complete() override {
      if (begun_) {
        callback_(begun_->take());
      } else {
        callback_(typename Pending::Result{unexpected{begun_.error()}});
      }
    }

   private:
    expected<Pending, CallError> begun_;
    Callback callback_;
  };

  void add(std::unique_ptr<Entry> entry) { open_.push_back(std::move(entry)); }

  std::vector<std::unique_ptr<Entry>> open_{};
};

/// Completions with a thread that waits and runs the callbacks:
///
///     auto thread = rpc::CompletionThread::start({.name = "replies"}).value();
///     thread->then(arm.begin_get_pose(), [](const auto& pose) { … });
///
/// Callbacks run one after the other on that thread and must not wait long: other callbacks wait
/// behind them. They may add calls.
/// Real-time class: set-up. The thread polls open calls once a millisecond; a loop that counts
/// microseconds holds the pending reply itself and waits for it.
/// @ownership as Completions; its end cancels what is open and joins the thread
/// @threads  then() from any
class CompletionThread {
 public:
  /// Starts the thread. Without a priority in `config` it is time-shared.
  /// @realtime set-up only
  /// @errors   as rt::Thread::start()
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

 private:
  class Impl;
  explicit CompletionThread(std::unique_ptr<Impl> impl) noexcept;
  void add(std::unique_ptr<Completions::Entry> entry);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::rpc
