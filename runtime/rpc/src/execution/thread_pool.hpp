#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "calls/pending.hpp"
#include "model/lead.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/transport/wait_set.hpp"

namespace rtpm::rpc {

class PooledExecution;

/// One thread of a pool, or a slot for one. Guarded by the pool's lock unless stated otherwise.
struct Worker {
  rt::Semaphore wake;  ///< Used without the lock.
  bool is_dynamic = false;
  PooledExecution* borrower = nullptr;  ///< The lane for which it runs `lent_call`, or null.
  PendingCall* lent_call = nullptr;
  rt::Thread thread;                   ///< Used by the acceptor only.
  bool is_started = false;             ///< Used by the acceptor only.
  std::atomic<bool> has_ended{false};  ///< Used without the lock.
};

/// A pool's answer to a request for a thread.
enum class BorrowedThread : std::uint8_t {
  kGiven,  ///< A thread runs the call.
  kSoon,   ///< A thread will be free in a moment and look for the borrower's calls.
  kNone,   ///< All threads are busy. The first free thread will look for the borrower's calls.
};

/// A call of a higher lane that needs a thread.
struct BorrowRequest {
  PooledExecution& borrower;
  std::uint32_t borrower_number;  ///< Higher means more urgent.
  PendingCall& call;              ///< The most urgent waiting call.
  std::uint32_t waiting_count;    ///< The borrower's waiting calls, including this one.
};

/// The threads of a lane with several threads, and the calls waiting for them.
///
/// One thread leads: only the leader receives. To run a call it hands the lead to an idle thread,
/// runs the call itself and answers it. So a call stays on one thread from arrival to reply, and
/// even while all other threads run calls, one still receives, orders calls by priority and refuses
/// surplus ones.
/// @threads  with the lock, unless stated otherwise
/// @realtime alloc-free except construction
class ThreadPool final : public transport::WaitLock {
 public:
  /// @param call_count_max  how many calls may wait
  /// @param leader          the wait set of the leader
  ThreadPool(const LaneConfig& config, std::uint32_t call_count_max, transport::WaitSet& leader);

  /// Whether the lane needs a pool; otherwise one thread does everything.
  [[nodiscard]] static bool is_wanted(const LaneConfig& config, bool borrows) noexcept {
    return borrows || config.static_threads > 1 || config.dynamic_threads > 0 ||
           config.buffered_request_max > 0;
  }
  /// How many threads it starts with.
  [[nodiscard]] static std::uint32_t static_count(const LaneConfig& config) noexcept {
    return config.static_threads + 1;  // One receives.
  }

  /// Acquires the lock as a follower. The leader holds it except while it sleeps and in
  /// yield_lock().
  [[nodiscard]] Lead& lock_as_follower() noexcept;
  void lock() noexcept override { static_cast<void>(lock_as_follower()); }
  void unlock() noexcept override { mutex_.unlock(); }
  /// Between the leader's turns: lets followers take the lock for a moment, and wakes an idle
  /// thread for a higher lane that requested one.
  void yield_lock() noexcept;

  /// Whether a call of this size may wait or start.
  [[nodiscard]] bool has_place_for(std::size_t size) const noexcept;
  void enqueue(PendingCall& call, Priority priority, std::size_t size) noexcept;
  /// Takes the most urgent call, if a thread may run it and another one remains to receive;
  /// otherwise null.
  [[nodiscard]] PendingCall* take_to_run() noexcept;
  /// Takes the most urgent call, or null.
  [[nodiscard]] PendingCall* take_any() noexcept;
  /// The most urgent call, which stays in the queue. Requires a waiting call.
  [[nodiscard]] PendingCall& first() noexcept { return *queue_.front().call; }
  /// Removes a call from the queue.
  void withdraw(const PendingCall& call) noexcept;
  /// Whether the leader should run a call, as another thread can take the lead.
  [[nodiscard]] bool has_call_to_run() const noexcept { return !queue_.empty() && has_follower(); }
  /// Whether a call waits but no thread is free.
  [[nodiscard]] bool has_stuck_call() const noexcept { return !queue_.empty() && !has_follower(); }
  [[nodiscard]] std::uint32_t queued_count() const noexcept {
    return static_cast<std::uint32_t>(queue_.size());
  }
  [[nodiscard]] std::uint32_t running_count() const noexcept { return running_count_; }
  void end_run() noexcept { --running_count_; }
  /// Records that a thread of a lower lane runs a call of this one, until end_run().
  void begin_borrowed_run() noexcept { ++running_count_; }

  /// Takes the lead for the calling thread; false if another thread has it.
  [[nodiscard]] bool take_lead() noexcept;
  /// Gives up the lead, and wakes an idle thread to take it.
  void leave_lead() noexcept;

  /// Rests without the lock until woken; false if a dynamic thread was not woken within `patience`.
  [[nodiscard]] bool rest(Worker& worker, Duration patience) noexcept;
  /// Lets an idle thread run a call of a higher lane. An unsuccessful request is remembered per
  /// borrower, for take_borrower().
  /// @threads  any, without the lock; never waits for it, so a busy leader of this lane does not
  ///           delay the higher lane
  [[nodiscard]] BorrowedThread lend(const BorrowRequest& request) noexcept;
  /// Returns the most urgent lane that asked without success, once; nullopt if there is none.
  [[nodiscard]] std::optional<std::uint32_t> take_borrower() noexcept;
  /// Announces that a lent thread is about to return, so that calls may wait for it.
  /// @threads  any
  void expect_back() noexcept { coming_back_.fetch_add(1, std::memory_order_relaxed); }
  /// Records that the thread is back, or will not return after all.
  /// @threads  any
  void end_expecting() noexcept { coming_back_.fetch_sub(1, std::memory_order_relaxed); }

  /// Ends all threads; wakes the idle ones.
  void end() noexcept;
  [[nodiscard]] bool is_over() const noexcept { return is_over_; }

  /// Requests one more dynamic thread. True if the acceptor must be woken for it.
  [[nodiscard]] bool ask_for_thread(MonotonicTime now) noexcept;
  /// @threads  any
  [[nodiscard]] bool is_thread_wanted() const noexcept {
    return asking_.load(std::memory_order_acquire) == Asking::kWanted;
  }
  /// Records that the system has no thread left.
  /// @threads  any
  void refuse_thread() noexcept { asking_.store(Asking::kRefused, std::memory_order_release); }
  /// Registers the calling thread at its start.
  void sign_on(const Worker& worker) noexcept;
  /// Unregisters the calling thread at its end.
  void sign_off(Worker& worker) noexcept;
  [[nodiscard]] std::deque<Worker>& workers() noexcept { return workers_; }

 private:
  enum class Asking : std::uint8_t { kNone, kWanted, kRefused };
  struct Waiting {
    PendingCall* call;
    Priority priority;
    std::uint64_t serial;
    std::size_t size;
    // Orders a heap with the greatest element in front.
    friend bool operator<(const Waiting& a, const Waiting& b) noexcept {
      if (a.priority != b.priority) return a.priority < b.priority;
      return a.serial > b.serial;
    }
  };

  // Whether a thread is free to lead, or about to be.
  [[nodiscard]] bool has_follower() const noexcept { return !called_.empty() || !resting_.empty(); }
  [[nodiscard]] bool give_thread(const BorrowRequest& request) noexcept;
  void call_helper() noexcept;
  void publish_spare() noexcept {
    spare_count_.store(static_cast<std::uint32_t>(resting_.size() + called_.size()),
                       std::memory_order_relaxed);
  }

  rt::PiMutex mutex_;
  Lead lead_;
  transport::WaitSet& leader_;
  std::atomic<std::uint32_t> follower_count_{0};  ///< Threads that wait for the lock.
  std::deque<Worker> workers_;                    ///< Has a fixed size and never moves.
  std::vector<Worker*> resting_;                  ///< Newest last, but dynamic threads first.
  std::vector<Worker*> called_;                   ///< Woken, but not yet holding the lock.
  /// Size of resting_ and called_, for lend() without the lock.
  std::atomic<std::uint32_t> spare_count_{0};
  /// Lanes that asked without success, one bit per lane number.
  std::atomic<std::uint64_t> borrowers_{0};
  std::vector<Waiting> queue_;  ///< A heap with a fixed capacity.
  std::uint64_t serial_ = 0;
  std::size_t queued_bytes_ = 0;
  std::uint32_t buffered_request_max_;
  std::size_t buffered_byte_max_;
  std::uint32_t running_count_ = 0;
  std::atomic<std::uint32_t> coming_back_{0};
  std::uint32_t dynamic_count_ = 0;
  std::uint32_t dynamic_count_max_;
  bool has_lead_ = false;
  bool is_over_ = false;
  std::atomic<Asking> asking_{Asking::kNone};
  MonotonicTime next_asking_{};
};

}  // namespace rtpm::rpc
