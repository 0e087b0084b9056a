#pragma once

#include <pthread.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"

namespace rtpm::rt {

/// What happens when the operating system refuses real-time scheduling or memory locking.
enum class RealtimeMode : std::uint8_t {
  kPrefer,   ///< Warns once on standard error, with the remedy, and goes on time-shared.
  kRequire,  ///< Set-up fails, with the remedy.
  kOff,      ///< Does not ask: for tests and tools.
};

/// "prefer", "require" or "off".
[[nodiscard]] std::string_view to_string(RealtimeMode mode) noexcept;

/// How a thread is to run.
struct ThreadConfig {
  std::string name;                    ///< Shown by the system; at most 15 bytes are.
  std::optional<Priority> priority{};  ///< SCHED_FIFO at its native level; none: time-shared.
  std::vector<int> cpus{};             ///< To which it is confined; empty: its starter's.
  RealtimeMode realtime = RealtimeMode::kPrefer;
};

/// Why the operating system did not give what was asked: one sentence with the remedy.
struct RealtimeError {
  std::string text;
};

/// A thread that runs `body` once, joined when it ends.
/// Threads: start and join from one thread.   Set-up only.
class Thread {
 public:
  Thread() noexcept = default;
  Thread(Thread&& other) noexcept;
  Thread& operator=(Thread&& other) noexcept;
  /// Joins.
  ~Thread();

  /// Starts `body` with its name, scheduling and affinity already in force.
  /// Errors: with kRequire, a right that the process lacks; a CPU that is not there; no thread
  /// left.
  [[nodiscard]] static expected<Thread, RealtimeError> start(const ThreadConfig& config,
                                                             std::function<void()> body);
  void join() noexcept;
  [[nodiscard]] bool is_running() const noexcept { return handle_.has_value(); }

 private:
  std::optional<pthread_t> handle_{};
};

/// Gives the calling thread name, scheduling and affinity.   Set-up only.
[[nodiscard]] expected<void, RealtimeError> configure_this_thread(const ThreadConfig& config);

}  // namespace rtpm::rt
