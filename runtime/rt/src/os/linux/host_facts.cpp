#include "os/host_facts.hpp"

#include <sys/prctl.h>
#include <sys/statvfs.h>
#include <sys/timex.h>
#include <time.h>

#include "rtpm/rt/native_time.hpp"

namespace rtpm::rt::os {

void ask_clocks(HostAnswers& answers) {
  timespec resolution{};
  if (clock_getres(CLOCK_MONOTONIC, &resolution) == 0) {
    answers.timer_resolution = to_duration(resolution);
  }
  answers.timer_slack = Duration{prctl(PR_GET_TIMERSLACK, 0, 0, 0, 0)};
  timex state{};
  const int answer = ::adjtimex(&state);
  answers.is_clock_synchronised =
      answer >= 0 && answer != TIME_ERROR && (state.status & STA_UNSYNC) == 0;
  answers.clock_error_us = state.maxerror;
}

void ask_shared_memory(HostAnswers& answers) {
  struct statvfs disk {};
  if (::statvfs("/dev/shm", &disk) != 0) return;
  answers.shared_memory_size = std::uint64_t{disk.f_blocks} * disk.f_frsize;
  answers.shared_memory_free = std::uint64_t{disk.f_bavail} * disk.f_frsize;
}

}  // namespace rtpm::rt::os
