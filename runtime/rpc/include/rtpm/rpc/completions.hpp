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

/// Calls in flight, each with a callback that the polling thread runs when the call ends:
///
///     completions.then(arm.begin_get_pose(), [&](const auto& pose) { show(pose); });
///     while (is_running) completions.wait(next_frame);
///
/// The callback gets the result of take(): the reply or the error, including a failure to start the
/// call. It runs once, in poll(), wait() or the destructor, and may add more calls.
/// @ownership holds the calls and callbacks; refers to the calls' bindings, which must outlive it.
///            Destruction cancels open calls: their callbacks get kCancelled
/// @threads  one at a time
/// @realtime adding allocates; waiting is alloc-free except for the callbacks
class Completions {
 public:
  Completions() noexcept = default;
  Completions(const Completions&) = delete;
  Completions& operator=(const Completions&) = delete;
  ~Completions();

  /// Adds the result of a generated begin_x() and the callback for when the call ends.
  template <class Pending, class Callback>
  void then(expected<Pending, CallError> begun, Callback callback) {
    add(std::make_unique<Call<Pending, Callback>>(std::move(begun), std::move(callback)));
  }

  /// Polls each call once, runs the callbacks of finished calls, and returns their number. Also
  /// resends lost frames, so call it regularly.
  /// @realtime at most two syscalls a call
  std::size_t poll();
  /// Waits until a call ends, at most until `until`, runs the callbacks and returns the number of
  /// finished calls. Polls each of several open calls once a millisecond. Returns at once if no
  /// call is open.
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
/// Callbacks run one at a time on that thread and must return quickly, since other callbacks wait
/// for them. They may add calls. Real-time class: set-up. The thread polls open calls once a
/// millisecond. A loop that counts microseconds should hold the PendingReply itself and wait for
/// it.
/// @ownership like Completions; destruction cancels open calls and joins the thread
/// @threads  then() from any
class CompletionThread {
 public:
  /// Starts the thread. Without a priority in `config` the thread is time-shared.
  /// @realtime set-up only
  /// @errors   those of rt::Thread::start()
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
