#pragma once

#include <optional>

#include "rtpm/base/time.hpp"

/// How real-time threads stay below the kernel's limit for real-time CPU use. The kernel stops a
/// SCHED_FIFO thread that takes all of a CPU, together with every other real-time thread on that
/// CPU, even the most urgent lane, for the rest of the period: by default 50 ms of each second.
/// Instead, the thread itself makes frequent short sleeps, which delay work by a tenth of a
/// millisecond at worst.
namespace rtpm::rt {

/// How much of each period the real-time threads of one CPU may run.
struct RealtimeLimit {
  Duration runtime{0};
  Duration period{0};
  /// False if the kernel does not limit real-time threads.
  [[nodiscard]] bool is_limited() const noexcept { return period > runtime; }
  /// The share of a CPU that they may take, from 0 to 1.
  [[nodiscard]] double share() const noexcept {
    return is_limited() ? static_cast<double>(runtime.count()) / static_cast<double>(period.count())
                        : 1;
  }
};

/// The limit for this process: the lower of kernel.sched_rt_runtime_us and the cpu.rt_runtime_us of
/// the control group that it was in at the first call. A limit that can't be read counts as none.
/// @realtime alloc-free; the first call in a process reads files
[[nodiscard]] RealtimeLimit realtime_limit() noexcept;

/// Accounts for one thread's time: awake, it spends; asleep, it earns, in the ratio of the limit
/// minus a reserve. The account covers all real-time work of the CPU: while a more urgent thread
/// runs, the preempted one counts as awake. Two busy real-time threads that share a CPU do not know
/// of each other: run all but one of them time-shared.
/// @threads  one
/// @realtime alloc-free, a few ns
class RealtimeBudget {
 public:
  /// The length of a pause: long compared with the cost of waking up.
  static constexpr Duration kPause = std::chrono::microseconds{100};
  /// How long a rested thread may run without a pause.
  static constexpr Duration kBurst = std::chrono::milliseconds{50};
  /// The share of the period left to other real-time work on the CPU.
  static constexpr double kReserve = 0.02;

  /// Creates a budget without a limit.
  constexpr RealtimeBudget() noexcept = default;
  RealtimeBudget(RealtimeLimit limit, MonotonicTime now) noexcept;

  [[nodiscard]] bool is_limited() const noexcept { return earned_per_slept_ > 0; }
  /// The share of its time that an otherwise busy thread must sleep.
  [[nodiscard]] double sleep_share() const noexcept {
    return is_limited() ? 1 / (1 + earned_per_slept_) : 0;
  }
  /// Whether to block rather than spin: for kPause, or until there is work. Compares a spent
  /// account with the thread's own CPU time first, which accounts for blocking elsewhere, such as
  /// in a method. Call it on the budget's thread.
  /// @realtime alloc-free, a syscall if the account is spent
  [[nodiscard]] bool must_pause(MonotonicTime now) noexcept {
    return is_spent(now) && is_spent_indeed(now);
  }
  /// Whether the account is spent, without comparing the thread's CPU time.
  [[nodiscard]] bool is_spent(MonotonicTime now) const noexcept { return now >= spent_; }
  /// Whether to sleep for kPause even if work arrives: work is so dense that the last block ended
  /// before it earned anything. One late answer is better than many slightly late ones.
  [[nodiscard]] bool must_sleep(MonotonicTime now) const noexcept {
    return is_block_in_vain_ && is_spent(now);
  }
  /// How long to sleep although there is work; call it after must_pause(). 0 while pauses between
  /// the work suffice.
  [[nodiscard]] Duration overdue(MonotonicTime now) const noexcept;
  /// Whether on_slept() needs the exact time off the CPU, because little of the budget is left.
  [[nodiscard]] bool is_exact(MonotonicTime now) const noexcept {
    return is_limited() && now >= spent_ - kBurst / 2;
  }
  /// Records that the thread blocked, and was off its CPU for `slept` of that time; nullopt if for
  /// nearly all of it.
  void on_slept(MonotonicTime begin, MonotonicTime end,
                std::optional<Duration> slept = std::nullopt) noexcept;

 private:
  /// Debts up to this are repaid in pauses between the work.
  static constexpr Duration kDebtMax = std::chrono::milliseconds{2};
  static constexpr Duration kWakeCost = std::chrono::microseconds{10};

  /// A longer time off the CPU without on_slept() means blocked, not preempted.
  static constexpr Duration kPreemptionMax = std::chrono::milliseconds{5};

  [[nodiscard]] bool is_spent_indeed(MonotonicTime now) noexcept;

  MonotonicTime spent_ = kNever;  ///< When the budget is spent if the thread stays awake.
  double earned_per_slept_ = 0;   ///< Awake time earned per time asleep; 0 if unlimited.
  bool is_block_in_vain_ = false;
  MonotonicTime compared_{};  ///< When the account was last compared with the thread's CPU time.
  Duration run_time_{0};      ///< The thread's CPU time then.
  Duration slept_{0};         ///< The sleep recorded since then.
};

/// The calling thread's budget. It is limited while RTPM keeps the thread at a real-time priority;
/// a priority set by other means is not noticed.
/// @realtime alloc-free
[[nodiscard]] RealtimeBudget& this_thread_budget() noexcept;

/// Encloses a blocking call, so that the calling thread's budget earns during it.
/// @realtime alloc-free, no syscall; with a limit it reads the clock twice, and with little budget
///           left also the thread's CPU time, by two syscalls
class AsleepScope {
 public:
  AsleepScope() noexcept;
  AsleepScope(const AsleepScope&) = delete;
  AsleepScope& operator=(const AsleepScope&) = delete;
  ~AsleepScope();

 private:
  MonotonicTime begin_{};
  std::optional<Duration> run_before_{};
};

}  // namespace rtpm::rt
