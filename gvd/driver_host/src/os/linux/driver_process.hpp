#pragma once

#include <sys/types.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "isolation.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::driver_host {

/// The process of an isolated driver, as seen by the process that started it.
/// @ownership ends the process: closes its sockets, which makes it deactivate its device, and sends
///            SIGKILL after a second
/// @threads  call() and kill() from one; call_calibration() from any
class DriverProcess {
 public:
  /// @errors   the system has no process, memory or descriptor left
  [[nodiscard]] static expected<std::shared_ptr<DriverProcess>, SetupError> start(
      const std::vector<std::string>& command);
  DriverProcess(const DriverProcess&) = delete;
  DriverProcess& operator=(const DriverProcess&) = delete;
  ~DriverProcess();

  [[nodiscard]] CycleMemory& memory() noexcept { return *memory_; }
  /// Receives the frame that the process sends unasked at its start.
  [[nodiscard]] std::optional<Frame> receive_facts(MonotonicTime deadline);
  /// Runs a call on the driver's thread; nullopt if the process ended, or did not answer by
  /// `deadline`.
  [[nodiscard]] std::optional<Frame> call(FrameKind kind, ConstBytes bytes, MonotonicTime deadline);
  /// Runs a call on the calibrations' thread; nullopt as with call().
  [[nodiscard]] std::optional<Frame> call_calibration(FrameKind kind, ConstBytes bytes,
                                                      MonotonicTime deadline);
  /// @realtime alloc-free, one system call
  [[nodiscard]] bool has_ended() const noexcept { return wait_for_end(Duration{0}); }
  /// Whether the process ends within `patience`.
  [[nodiscard]] bool wait_for_end(Duration patience) const noexcept;
  void kill() noexcept;
  /// How the process ended: "signal 11 (Segmentation fault)", "exit code 1".
  [[nodiscard]] std::string end_text();
  [[nodiscard]] pid_t number() const noexcept { return number_; }

 private:
  DriverProcess() = default;
  void reap() noexcept;

  pid_t number_ = -1;
  Handle ending_{};  ///< The process's pidfd: readable when it has ended.
  Handle control_{};
  Handle calibration_{};
  CycleMemory* memory_ = nullptr;
  rt::PiMutex calibration_mutex_{};
  std::optional<int> status_{};  ///< As returned by waitpid().
};

}  // namespace rtpm::driver_host
