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

/// What happens when the operating system refuses real-time scheduling or memory locking.
enum class RealtimeMode : std::uint8_t {
  kPrefer,   ///< Warns once on standard error, with the remedy, and goes on time-shared.
  kRequire,  ///< Set-up fails, with the remedy.
  kOff,      ///< Does not ask: for tests and tools.
};

/// "prefer", "require" or "off".
[[nodiscard]] std::string_view to_string(RealtimeMode mode) noexcept;

/// Among whom the system shares the CPU out.
enum class Schedule : std::uint8_t {
  /// SCHED_FIFO: before all time-shared threads, and before those of lower priority. What keeps a
  /// CPU busy there is subject to the kernel's throttling, see budget.hpp.
  kFifo,
  /// With everything else on the machine, behind every real-time thread: for work that may fill a
  /// CPU and is not urgent.
  kTimeShared,
};

/// "fifo" or "time-shared".
[[nodiscard]] std::string_view to_string(Schedule schedule) noexcept;

/// How a thread is to run.
struct ThreadConfig {
  std::string name;                    ///< Shown by the system; at most 15 bytes are.
  std::optional<Priority> priority{};  ///< SCHED_FIFO at its native level; none: time-shared.
  std::vector<int> cpus{};             ///< To which it is confined; empty: its starter's.
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
  /// @errors   with kRequire, a right that the process lacks; a CPU that is not there; no thread
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

/// Says what becomes of a thread that is to spin without end. Where the kernel throttles, one at
/// SCHED_FIFO can't: it pauses as budget.hpp says, which setup_report() tells.
/// @realtime set-up only
/// @errors   with kRequire, the throttling, as a pause is not what was asked for
[[nodiscard]] expected<void, SetupError> check_spinning(const ThreadConfig& config);

}  // namespace rtpm::rt
