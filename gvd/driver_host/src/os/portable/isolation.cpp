#include "rtpm/driver_host/isolated.hpp"

namespace rtpm::driver_host {

expected<std::unique_ptr<driver::Driver>, SetupError> isolate(IsolationConfig) {
  return setup_error(
      "a driver can't have a process of its own", "RTPM has that on Linux only",
      "give its device a program of its own, such as an rtpm-deviced with this device "
      "only, and leave isolation out");
}

int serve_driver(expected<std::unique_ptr<driver::Driver>, SetupError>, const rt::ThreadConfig&) {
  return 1;
}

}  // namespace rtpm::driver_host
