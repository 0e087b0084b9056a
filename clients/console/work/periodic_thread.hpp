#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::console {

/// A time-shared thread that runs its work periodically until it is stopped.
/// @threads  wake(): any; the rest: one
class PeriodicThread {
 public:
  PeriodicThread() = default;
  PeriodicThread(const PeriodicThread&) = delete;
  PeriodicThread& operator=(const PeriodicThread&) = delete;
  ~PeriodicThread() { stop(); }

  /// Repeatedly runs `work`, then waits for `period` or wake().
  [[nodiscard]] expected<void, SetupError> start(const std::string& name, Duration period,
                                                 std::function<void()> work);
  /// Starts the next run now.
  void wake();
  /// Waits for the current run.
  void stop();

 private:
  void run(Duration period, const std::function<void()>& work);

  std::mutex mutex_{};
  std::condition_variable changed_{};
  bool is_awake_ = false;
  bool is_stopping_ = false;
  rt::Thread thread_{};
};

}  // namespace rtpm::console
