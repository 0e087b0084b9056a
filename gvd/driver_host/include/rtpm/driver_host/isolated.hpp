#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/driver/driver.hpp"
#include "rtpm/rt/thread.hpp"

/// A driver in a process of its own: it can crash, hang or overwrite that process only.
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
  /// The program of the driver's process, and its arguments. It calls serve_driver().
  std::vector<std::string> command{};
  /// How long exchange() waits for the other process; by default half of the period.
  std::optional<Duration> exchange_patience{};
  /// How long the process may take to make the driver, and configure() and activate() each.
  Duration set_up_patience = std::chrono::seconds{30};
  IsolationListener* listener = nullptr;  ///< May be null.
};

/// Starts `config.command` and returns its driver, as if that were in this process.
///
/// exchange() waits for its answer no longer than its patience: a later answer counts in the next
/// cycle, a missing answer is kLate, and a process that has ended is kGone at once. deactivate()
/// kills a process that no longer runs cycles, and starts it again: its configure()
/// and deactivate() make the device safe before the next configure(). A process that gets no newer
/// command until Command::deadline takes the force away itself, and deactivates the device when
/// this process has ended, however that ended.
/// @ownership the driver owns the process; its calibrations keep it, too
/// @realtime set-up only, but for exchange(): alloc-free, a few system calls
/// @errors   the process can't be started, or its driver can't be made, in the latter's words
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> isolate(IsolationConfig config);

/// The other process's side: serves `driver`, or its error, to the process that started this one
/// by isolate(), until that ends it. Returns the exit code.
/// @param thread  the thread that calls the driver; configured as the device's
/// @realtime set-up only
[[nodiscard]] int serve_driver(expected<std::unique_ptr<driver::Driver>, SetupError> driver,
                               const rt::ThreadConfig& thread);

}  // namespace rtpm::driver_host
