#pragma once

#include <optional>

#include "rtpm/base/time.hpp"

/// How real-time threads stay below the share of a CPU that the kernel leaves them. A SCHED_FIFO
/// thread that takes all of a CPU is stopped, with every other real-time thread of that CPU, for
/// the rest of the period: 50 ms of each second by default, the most urgent lane included. Sleeping
/// a little, often, and of one's own accord costs a tenth of a millisecond at worst instead.
namespace rtpm::rt {

/// How much of each period the real-time threads of one CPU may run.
struct RealtimeLimit {
  Duration runtime{0};
  Duration period{0};
  /// False: nothing stops them.
  [[nodiscard]] bool is_limited() const noexcept { return period > runtime; }
};

/// The limit of this process: the narrower of kernel.sched_rt_runtime_us and the cpu.rt_runtime_us
/// of the control group it was in when this was first asked. Nothing limits where the system does
/// not tell.
/// @realtime alloc-free; the first call in a process reads files
[[nodiscard]] RealtimeLimit realtime_limit() noexcept;

/// Keeps account of one thread's time. Awake, it spends; asleep, it earns, at the ratio of the
/// limit less a reserve. What is meant is all of the CPU's real-time work: while a more urgent
/// thread runs, the one below it counts as awake. Two busy threads that share a CPU at real-time
/// levels do not know of each other: run all but one of them time-shared.
/// @threads  one
/// @realtime alloc-free, a few ns
class RealtimeBudget {
 public:
  /// How long a sleep for the budget's sake is: long beside the cost of waking up.
  static constexpr Duration kPause = std::chrono::microseconds{100};
  /// How long a rested thread may run without a pause.
  static constexpr Duration kBurst = std::chrono::milliseconds{50};
  /// How much is left to other real-time work of the CPU, as a share of the period.
  static constexpr double kReserve = 0.02;

  /// Without a limit.
  constexpr RealtimeBudget() noexcept = default;
  RealtimeBudget(RealtimeLimit limit, MonotonicTime now) noexcept;

  [[nodiscard]] bool is_limited() const noexcept { return earned_per_slept_ > 0; }
  /// Which part of its time a thread must sleep that would never do so by itself.
  [[nodiscard]] double sleep_share() const noexcept {
    return is_limited() ? 1 / (1 + earned_per_slept_) : 0;
  }
  /// Whether to block rather than spin: for kPause, or until there is work. Where the account says
  /// so it is held against the thread's own time first, which has what blocked elsewhere: in a
  /// method, say. For the thread itself.
  /// @realtime alloc-free, a syscall when the account says so
  [[nodiscard]] bool must_pause(MonotonicTime now) noexcept {
    return is_spent(now) && is_spent_indeed(now);
  }
  /// What the account says.
  [[nodiscard]] bool is_spent(MonotonicTime now) const noexcept { return now >= spent_; }
  /// Whether to sleep for kPause instead, whatever comes: work is so dense that the last block
  /// ended before it had earned anything. One late answer is better than many that are a little
  /// late.
  [[nodiscard]] bool must_sleep(MonotonicTime now) const noexcept {
    return is_block_in_vain_ && is_spent(now);
  }
  /// How long to sleep although there is work, for after must_pause(); 0 for as long as pauses
  /// between the work will do.
  [[nodiscard]] Duration overdue(MonotonicTime now) const noexcept;
  /// Whether on_slept() is to be told the very time that the thread was off its CPU: where there is
  /// little left, it matters.
  [[nodiscard]] bool is_exact(MonotonicTime now) const noexcept {
    return is_limited() && now >= spent_ - kBurst / 2;
  }
  /// The thread blocked, and was off its CPU for `slept` of the time; none: about all of it.
  void on_slept(MonotonicTime begin, MonotonicTime end,
                std::optional<Duration> slept = std::nullopt) noexcept;

 private:
  /// Debts up to this are left to the pauses between the work.
  static constexpr Duration kDebtMax = std::chrono::milliseconds{2};
  static constexpr Duration kWakeCost = std::chrono::microseconds{10};

  /// Off the CPU for longer than this without a word: blocked, not preempted.
  static constexpr Duration kPreemptionMax = std::chrono::milliseconds{5};

  [[nodiscard]] bool is_spent_indeed(MonotonicTime now) noexcept;

  MonotonicTime spent_ = kNever;  ///< When the budget is spent if the thread stays awake.
  double earned_per_slept_ = 0;   ///< Time awake for time asleep; 0: no limit.
  bool is_block_in_vain_ = false;
  MonotonicTime compared_{};  ///< When the account was last held against the thread's own time,
  Duration run_time_{0};      ///< that time then,
  Duration slept_{0};         ///< and how much sleep was entered since.
};

/// The calling thread's. It has a limit while RTPM has the thread at a real-time level; a level
/// that was set by other means is not noticed.
/// @realtime alloc-free
[[nodiscard]] RealtimeBudget& this_thread_budget() noexcept;

/// Stands round whatever blocks, so that the calling thread's budget earns.
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
