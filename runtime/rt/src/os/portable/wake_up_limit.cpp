#include "os/wake_up_limit.hpp"

namespace rtpm::rt::os {

expected<int, SetupError> limit_wake_up(std::int32_t) {
  return unexpected{SetupError{"CPUs can't be kept from deep sleep: this system has no such right",
                               {},
                               "say --cpu-latency off.",
                               {}}};
}

void end_wake_up_limit(int) noexcept {}

}  // namespace rtpm::rt::os
