#include "drivers.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/device_serial/open.hpp"
#include "serial_model.hpp"

namespace rtpm::test {
namespace {

/// A paddle that resets when its port is opened.
std::unique_ptr<driver::Driver> make_serial() {
  const auto model = std::make_shared<SerialModel>();
  auto opened = device_serial::open(
      "port=/dev/ttyACM0", "paddle", [] { return std::vector<device_serial::Port>{}; },
      open_model(model, true));
  RTPM_ASSERT(opened.has_value(), "the scripted board could not be opened");
  return std::move(*opened);
}

[[maybe_unused]] const bool kIsAdded = add_driver({"Serial", &make_serial});

}  // namespace
}  // namespace rtpm::test
