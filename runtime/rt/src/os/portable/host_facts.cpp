#include "os/host_facts.hpp"

#include <ctime>

#include "rtpm/rt/native_time.hpp"

namespace rtpm::rt::os {

void ask_clocks(HostAnswers& answers) {
  timespec resolution{};
  if (clock_getres(CLOCK_MONOTONIC, &resolution) == 0) {
    answers.timer_resolution = to_duration(resolution);
  }
}

void ask_shared_memory(HostAnswers&) {}

}  // namespace rtpm::rt::os
