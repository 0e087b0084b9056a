#include <sys/prctl.h>
#include <sys/statvfs.h>
#include <sys/timex.h>
#include <time.h>

#include "rtpm/rt/cpu_latency.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/native_time.hpp"
#include "rtpm/rt/survey.hpp"
#include "rtpm/rt/thread.hpp"
#include "setup_text.hpp"

// The system's answers to the requests that RTPM makes.
namespace rtpm::rt {
namespace {

void ask_rights(HostAnswers& answers) {
  const auto thread = Thread::start({.name = "rtpm-survey",
                                     .priority = Priority{Priority::kHighest},
                                     .realtime = RealtimeMode::kRequire},
                                    [] {});
  if (!thread) answers.realtime_refusal = thread.error();
  if (auto locked = lock_memory(RealtimeMode::kRequire); !locked) {
    answers.memory_lock_refusal = locked.error();
  }
  if (auto request = CpuLatencyRequest::open(Duration{0}, RealtimeMode::kRequire); !request) {
    answers.cpu_latency_refusal = request.error();
  }
  answers.is_group_without_realtime = is_group_without_realtime();
  answers.realtime_limit = realtime_limit();
}

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

}  // namespace

HostAnswers ask_host() {
  HostAnswers answers;
  ask_rights(answers);
  answers.usable_cpu_count = usable_cpu_count();
  ask_clocks(answers);
  ask_shared_memory(answers);
  return answers;
}

}  // namespace rtpm::rt
