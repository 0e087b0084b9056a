#pragma once

#include <atomic>
#include <functional>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::device_io {

/// The thread in which a driver talks to its hardware, so that exchange() never waits for it.
/// Exchange values with it through base::Latest.
/// @threads  start and stop it from one thread
class IoThread {
 public:
  IoThread() = default;
  IoThread(const IoThread&) = delete;
  IoThread& operator=(const IoThread&) = delete;
  /// Stops.
  ~IoThread() { stop(); }

  /// Calls `step` until it returns false or stop() is called. `step` waits for the hardware for at
  /// most about 100 ms; stop() may wait as long.
  /// @param step  must not throw
  /// @errors   those of rt::Thread::start()
  [[nodiscard]] expected<void, SetupError> start(const rt::ThreadConfig& config,
                                                 std::function<bool()> step);
  /// Makes the thread end after `step` returns, without waiting for that. If `step` waits for
  /// something other than its hardware, wake it after this call and before stop().
  void request_stop() noexcept { is_stopping_.store(true, std::memory_order_relaxed); }
  /// Waits until `step` has returned. Has no effect if the thread was not started.
  void stop() noexcept;

 private:
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_{};
};

}  // namespace rtpm::device_io
