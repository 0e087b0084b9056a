#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"

namespace rtpm::rt {

/// The action if the operating system refuses real-time scheduling or memory locking.
enum class RealtimeMode : std::uint8_t {
  kPrefer,   ///< Warns once on standard error, with the remedy, and continues time-shared.
  kRequire,  ///< Set-up fails, with the remedy.
  kOff,      ///< Requests nothing: for tests and tools.
};

/// "prefer", "require" or "off".
[[nodiscard]] std::string_view to_string(RealtimeMode mode) noexcept;

/// Scheduling policy.
enum class Schedule : std::uint8_t {
  /// SCHED_FIFO: above all time-shared threads and all threads of lower priority. A thread that
  /// keeps its CPU busy is subject to the kernel's throttling, see budget.hpp.
  kFifo,
  /// Shares the CPU with all other processes, below every real-time thread: for work that may keep
  /// a CPU busy and is not urgent.
  kTimeShared,
};

/// "fifo" or "time-shared".
[[nodiscard]] std::string_view to_string(Schedule schedule) noexcept;

/// The configuration of a thread.
struct ThreadConfig {
  std::string name;  ///< The system shows only its first 15 bytes.
  /// Runs as SCHED_FIFO at its native level; nullopt if time-shared.
  std::optional<Priority> priority{};
  /// The CPUs that it is confined to; by default those of the starting thread.
  std::vector<int> cpus{};
  RealtimeMode realtime = RealtimeMode::kPrefer;
  /// With kTimeShared, the priority applies only to the thread's calls.
  Schedule schedule = Schedule::kFifo;
};

/// A thread that runs `body` once. Joined on destruction.
/// @threads  start and join from one thread
/// @realtime set-up only
class Thread {
 public:
  Thread() noexcept = default;
  Thread(Thread&& other) noexcept;
  Thread& operator=(Thread&& other) noexcept;
  /// Joins the thread.
  ~Thread();

  /// Starts `body` with its name, scheduling and affinity already set.
  /// @errors   with kRequire, the process lacks a right; a CPU that does not exist; no thread left
  [[nodiscard]] static expected<Thread, SetupError> start(const ThreadConfig& config,
                                                          std::function<void()> body);
  void join() noexcept;
  [[nodiscard]] bool is_running() const noexcept { return handle_.has_value(); }

 private:
  std::optional<std::uintptr_t> handle_{};  ///< The system's.
};

/// Sets the calling thread's name, scheduling and affinity.
/// @realtime set-up only
[[nodiscard]] expected<void, SetupError> configure_this_thread(const ThreadConfig& config);

/// Checks whether a thread may spin endlessly. Under the kernel's throttling a SCHED_FIFO thread
/// can't: it pauses as budget.hpp describes, and setup_report() reports that.
/// @realtime set-up only
/// @errors   with kRequire, the throttling, since pauses were not requested
[[nodiscard]] expected<void, SetupError> check_spinning(const ThreadConfig& config);

}  // namespace rtpm::rt
