#include "rtpm/driver/driver.hpp"

namespace rtpm::driver {

expected<void, SetupError> Driver::set_parameters(std::span<ParameterSetting> settings) {
  if (settings.empty()) return {};
  return setup_error("this device has no parameters");
}

std::unique_ptr<Calibration> Driver::make_calibration(std::string_view) {
  return nullptr;
}

}  // namespace rtpm::driver
