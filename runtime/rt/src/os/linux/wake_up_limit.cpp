#include "os/wake_up_limit.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

namespace rtpm::rt::os {

expected<int, SetupError> limit_wake_up(std::int32_t us) {
  const int file = ::open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC);
  if (file >= 0 && ::write(file, &us, sizeof us) == sizeof us) return file;
  const std::error_code cause = system_error(errno);
  if (file >= 0) ::close(file);
  return unexpected{
      SetupError{"CPUs can't be kept from deep sleep (/dev/cpu_dma_latency: " + cause.message() +
                     "): waking may take longer",
                 {},
                 "give the user write access to /dev/cpu_dma_latency (a udev rule, or run as "
                 "root), or say --cpu-latency off.",
                 cause}};
}

void end_wake_up_limit(int limit) noexcept {
  ::close(limit);
}

}  // namespace rtpm::rt::os
