#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/driver/driver.hpp"
#include "rtpm/rt/thread.hpp"

/// Runs a driver in its own process, so that it can crash, hang or overwrite only that process.
namespace rtpm::driver_host {

/// Receives the state changes of a driver's process.
/// @threads  the thread that calls the driver
class IsolationListener {
 public:
  virtual ~IsolationListener() = default;
  virtual void report(std::string_view text) = 0;
};

/// Configures isolate().
struct IsolationConfig {
  /// The program of the driver's process, and its arguments. The program calls serve_driver().
  std::vector<std::string> command{};
  /// How long exchange() waits for the driver's process; by default half a period.
  std::optional<Duration> exchange_patience{};
  /// How long creating the driver, configure() and activate() may each take in the process.
  Duration set_up_patience = std::chrono::seconds{30};
  IsolationListener* listener = nullptr;  ///< May be null.
};

/// Starts `config.command` and returns its driver, usable as if it were in this process.
///
/// exchange() waits for its answer no longer than its patience. A later answer counts in the next
/// cycle; a missing answer is kLate; if the process has ended, exchange() returns kGone at once.
/// deactivate() kills a process that no longer runs cycles, and restarts it: configure() and
/// deactivate() in the new process make the device safe before the next configure(). Without a
/// newer command until Command::deadline, the driver's process itself removes the force. If this
/// process ends in any way, the driver's process deactivates the device.
/// @ownership the driver owns the process; its calibrations also keep it
/// @realtime set-up only, except exchange(): alloc-free, a few system calls
/// @errors   the process can't be started, or it can't create its driver, with its message
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> isolate(IsolationConfig config);

/// The side of the driver's process: serves `driver`, or its error, to the process that called
/// isolate(), until told to end. Returns the exit code.
/// @param thread  configures the thread that calls the driver, like the device's
/// @realtime set-up only
[[nodiscard]] int serve_driver(expected<std::unique_ptr<driver::Driver>, SetupError> driver,
                               const rt::ThreadConfig& thread);

}  // namespace rtpm::driver_host
