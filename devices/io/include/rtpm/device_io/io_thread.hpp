#pragma once

#include <atomic>
#include <functional>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::device_io {

/// The thread of a driver that talks to its hardware, so that exchange() never waits for it. Pass
/// values to and from it by base::Latest.
/// @threads  start and stop from one thread
class IoThread {
 public:
  IoThread() = default;
  IoThread(const IoThread&) = delete;
  IoThread& operator=(const IoThread&) = delete;
  /// Stops.
  ~IoThread() { stop(); }

  /// Calls `step` until it returns false or stop() is called. `step` waits for its hardware, with a
  /// deadline of at most some 100 ms, which stop() may take, too.
  /// @param step  throws nothing
  /// @errors   as of rt::Thread::start()
  [[nodiscard]] expected<void, SetupError> start(const rt::ThreadConfig& config,
                                                 std::function<bool()> step);
  /// Makes the thread end once `step` has returned, without waiting for it. If `step` waits for
  /// more than its hardware, wake it after this call and before stop().
  void request_stop() noexcept { is_stopping_.store(true, std::memory_order_relaxed); }
  /// Waits until `step` has returned. No effect if not started.
  void stop() noexcept;

 private:
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_{};
};

}  // namespace rtpm::device_io
