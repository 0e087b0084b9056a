#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/driver.hpp"

/// Checks the promises that every driver makes in rtpm/driver/driver.hpp.
namespace rtpm::driver_host {

/// Creates a new driver under test for each call.
class DriverMaker {
 public:
  virtual ~DriverMaker() = default;
  [[nodiscard]] virtual expected<std::unique_ptr<driver::Driver>, SetupError> make() = 0;
};

/// How time passes for the driver under test.
enum class CheckPace : std::uint8_t {
  kSimulated,  ///< Without waiting, for drivers whose device is a model.
  kReal,       ///< One exchange() per period.
};

/// A check of one promise.
struct DriverCheck {
  const char* name;  ///< "DescribesItselfWhole".
  void (*run)(class DriverTrial& trial);
};

/// All checks; those that need no device come first.
[[nodiscard]] std::span<const DriverCheck> driver_checks();

/// Runs `check` with its own driver. Applies maximum forces: keep hands off the device.
/// @return the breaches, at most ten; empty if the driver keeps the promise
/// @realtime set-up only
[[nodiscard]] std::vector<std::string> run_check(const DriverCheck& check, DriverMaker& maker,
                                                 Duration period, CheckPace pace);

}  // namespace rtpm::driver_host
