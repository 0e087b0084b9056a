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
/// @threads  wake() from any; the rest from one
class PeriodicThread {
 public:
  PeriodicThread() = default;
  PeriodicThread(const PeriodicThread&) = delete;
  PeriodicThread& operator=(const PeriodicThread&) = delete;
  ~PeriodicThread() { stop(); }

  /// Runs `work`, then waits for `period` or wake(), and so on.
  [[nodiscard]] expected<void, SetupError> start(const std::string& name, Duration period,
                                                 std::function<void()> work);
  /// Makes the next run start now.
  void wake();
  /// Waits for the present run.
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
