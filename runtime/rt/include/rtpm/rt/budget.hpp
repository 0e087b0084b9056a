#pragma once

#include <optional>

#include "rtpm/base/time.hpp"

/// How real-time threads stay below the share of a CPU that the kernel leaves them. The kernel
/// stops a SCHED_FIFO thread that takes all of a CPU, with every other real-time thread of that CPU
/// and so the most urgent lane too, for the rest of the period: 50 ms of each second by default.
/// Frequent short sleeps of the thread's own cost a tenth of a millisecond at worst instead.
namespace rtpm::rt {

/// How much of each period the real-time threads of one CPU may run.
struct RealtimeLimit {
  Duration runtime{0};
  Duration period{0};
  /// False if nothing stops them.
  [[nodiscard]] bool is_limited() const noexcept { return period > runtime; }
};

/// The limit of this process: the narrower of kernel.sched_rt_runtime_us and the cpu.rt_runtime_us
/// of the control group that it was in at the first call. A limit that can't be read counts as
/// none.
/// @realtime alloc-free; the first call in a process reads files
[[nodiscard]] RealtimeLimit realtime_limit() noexcept;

/// Keeps account of one thread's time. Awake, it spends; asleep, it earns, at the ratio of the
/// limit less a reserve. The account covers all of the CPU's real-time work: while a more urgent
/// thread runs, the one below it counts as awake. Two busy threads that share a CPU at real-time
/// levels do not know of each other: run all but one of them time-shared.
/// @threads  one
/// @realtime alloc-free, a few ns
class RealtimeBudget {
 public:
  /// The length of a sleep for the budget's sake: long beside the cost of waking up.
  static constexpr Duration kPause = std::chrono::microseconds{100};
  /// How long a rested thread may run without a pause.
  static constexpr Duration kBurst = std::chrono::milliseconds{50};
  /// How much is left to other real-time work of the CPU, as a share of the period.
  static constexpr double kReserve = 0.02;

  /// Without a limit.
  constexpr RealtimeBudget() noexcept = default;
  RealtimeBudget(RealtimeLimit limit, MonotonicTime now) noexcept;

  [[nodiscard]] bool is_limited() const noexcept { return earned_per_slept_ > 0; }
  /// The share of its time that a thread without sleeps of its own must sleep.
  [[nodiscard]] double sleep_share() const noexcept {
    return is_limited() ? 1 / (1 + earned_per_slept_) : 0;
  }
  /// Whether to block rather than spin: for kPause, or until there is work. A spent account is
  /// first compared with the thread's own CPU time, which includes blocking elsewhere, such as in a
  /// method. For the thread itself.
  /// @realtime alloc-free, a syscall when the account says so
  [[nodiscard]] bool must_pause(MonotonicTime now) noexcept {
    return is_spent(now) && is_spent_indeed(now);
  }
  /// Whether the account is spent, without that comparison.
  [[nodiscard]] bool is_spent(MonotonicTime now) const noexcept { return now >= spent_; }
  /// Whether to sleep for kPause even if work arrives: work is so dense that the last block ended
  /// before it had earned anything. One late answer is better than many slightly late ones.
  [[nodiscard]] bool must_sleep(MonotonicTime now) const noexcept {
    return is_block_in_vain_ && is_spent(now);
  }
  /// How long to sleep although there is work, to be called after must_pause(); 0 while pauses
  /// between the work suffice.
  [[nodiscard]] Duration overdue(MonotonicTime now) const noexcept;
  /// Whether on_slept() needs the exact time that the thread was off its CPU: it matters when
  /// little of the budget is left.
  [[nodiscard]] bool is_exact(MonotonicTime now) const noexcept {
    return is_limited() && now >= spent_ - kBurst / 2;
  }
  /// The thread blocked, and was off its CPU for `slept` of the time; nullopt if about all of it.
  void on_slept(MonotonicTime begin, MonotonicTime end,
                std::optional<Duration> slept = std::nullopt) noexcept;

 private:
  /// Debts up to this are left to the pauses between the work.
  static constexpr Duration kDebtMax = std::chrono::milliseconds{2};
  static constexpr Duration kWakeCost = std::chrono::microseconds{10};

  /// Off the CPU for longer than this without on_slept(): blocked, not preempted.
  static constexpr Duration kPreemptionMax = std::chrono::milliseconds{5};

  [[nodiscard]] bool is_spent_indeed(MonotonicTime now) noexcept;

  MonotonicTime spent_ = kNever;  ///< When the budget is spent if the thread stays awake.
  double earned_per_slept_ = 0;   ///< Time awake for time asleep; 0 if unlimited.
  bool is_block_in_vain_ = false;
  MonotonicTime compared_{};  ///< When the account was last compared with the thread's own time,
  Duration run_time_{0};      ///< that time then,
  Duration slept_{0};         ///< and how much sleep was entered since.
};

/// The calling thread's budget. It has a limit while RTPM keeps the thread at a real-time level; a
/// level set by other means is not noticed.
/// @realtime alloc-free
[[nodiscard]] RealtimeBudget& this_thread_budget() noexcept;

/// Encloses a blocking call, so that the calling thread's budget earns.
/// @realtime alloc-free, no syscall; where there is a limit it reads the clock twice, and where the
///           budget is nearly spent, with two syscalls, the thread's own time
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
