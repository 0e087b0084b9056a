#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/driver.hpp"

/// The promises of rtpm/driver/driver.hpp that every driver makes, as checks.
namespace rtpm::driver_host {

/// Makes the driver under test, as often as it is asked.
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

/// One promise.
struct DriverCheck {
  const char* name;  ///< "DescribesItselfWhole".
  void (*run)(class DriverTrial& trial);
};

/// All checks; the ones that need no device come first.
[[nodiscard]] std::span<const DriverCheck> driver_checks();

/// Runs `check` with a driver of its own. It commands the greatest forces: keep hands off the
/// device.
/// @return the breaches, at most ten; empty if the driver keeps the promise
/// @realtime set-up only
[[nodiscard]] std::vector<std::string> run_check(const DriverCheck& check, DriverMaker& maker,
                                                 Duration period, CheckPace pace);

}  // namespace rtpm::driver_host
