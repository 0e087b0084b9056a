#include "os/host_facts.hpp"
#include "rtpm/rt/cpu_latency.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/memory.hpp"
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
  answers.is_group_without_realtime =
      answers.realtime_refusal.has_value() && is_group_without_realtime();
  answers.realtime_limit = realtime_limit();
}

}  // namespace

HostAnswers ask_host() {
  HostAnswers answers;
  ask_rights(answers);
  answers.usable_cpu_count = usable_cpu_count();
  os::ask_clocks(answers);
  os::ask_shared_memory(answers);
  return answers;
}

}  // namespace rtpm::rt
