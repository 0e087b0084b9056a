#pragma once

#include <pthread.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"

namespace rtpm::rt {

/// The reaction to the operating system's refusal of real-time scheduling or memory locking.
enum class RealtimeMode : std::uint8_t {
  kPrefer,   ///< Warns once on standard error, with the remedy, and goes on time-shared.
  kRequire,  ///< Set-up fails, with the remedy.
  kOff,      ///< Does not ask: for tests and tools.
};

/// "prefer", "require" or "off".
[[nodiscard]] std::string_view to_string(RealtimeMode mode) noexcept;

/// Scheduling policy.
enum class Schedule : std::uint8_t {
  /// SCHED_FIFO: before all time-shared threads, and before those of lower priority. A thread that
  /// keeps its CPU busy is subject to the kernel's throttling, see budget.hpp.
  kFifo,
  /// Shares the CPU with everything else on the machine, behind every real-time thread: for work
  /// that may fill a CPU and is not urgent.
  kTimeShared,
};

/// "fifo" or "time-shared".
[[nodiscard]] std::string_view to_string(Schedule schedule) noexcept;

/// How a thread is to run.
struct ThreadConfig {
  std::string name;                    ///< The system shows its first 15 bytes.
  std::optional<Priority> priority{};  ///< SCHED_FIFO at its native level; nullopt if time-shared.
  std::vector<int> cpus{};             ///< CPUs that it is confined to; by default its starter's.
  RealtimeMode realtime = RealtimeMode::kPrefer;
  /// kTimeShared: the priority is that of its calls only.
  Schedule schedule = Schedule::kFifo;
};

/// A thread that runs `body` once, joined when it ends.
/// @threads  start and join from one thread
/// @realtime set-up only
class Thread {
 public:
  Thread() noexcept = default;
  Thread(Thread&& other) noexcept;
  Thread& operator=(Thread&& other) noexcept;
  /// Joins.
  ~Thread();

  /// Starts `body` with its name, scheduling and affinity already in force.
  /// @errors   with kRequire, a right that the process lacks; a CPU that does not exist; no thread
  ///           left
  [[nodiscard]] static expected<Thread, SetupError> start(const ThreadConfig& config,
                                                          std::function<void()> body);
  void join() noexcept;
  [[nodiscard]] bool is_running() const noexcept { return handle_.has_value(); }

 private:
  std::optional<pthread_t> handle_{};
};

/// Gives the calling thread name, scheduling and affinity.
/// @realtime set-up only
[[nodiscard]] expected<void, SetupError> configure_this_thread(const ThreadConfig& config);

/// Checks whether a thread may spin without end. Under the kernel's throttling a SCHED_FIFO thread
/// can't: it pauses as budget.hpp describes, and setup_report() reports that.
/// @realtime set-up only
/// @errors   with kRequire, the throttling, as a pause is not what was asked for
[[nodiscard]] expected<void, SetupError> check_spinning(const ThreadConfig& config);

}  // namespace rtpm::rt
