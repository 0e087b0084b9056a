#include "os/native_thread.hpp"

#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>

#include <cerrno>

#include "setup_text.hpp"

namespace rtpm::rt::os {

void name_this_thread(const std::string& name) noexcept {
  // The system accepts at most 15 bytes; truncate the name instead of losing it.
  pthread_setname_np(pthread_self(), name.substr(0, 15).c_str());
}

expected<void, SetupError> confine_this_thread(const std::string& subject,
                                               const std::vector<int>& numbers) {
  cpu_set_t cpus;
  CPU_ZERO(&cpus);
  bool is_possible = true;
  std::string list;
  for (const int cpu : numbers) {
    if (cpu >= 0 && cpu < CPU_SETSIZE) {
      CPU_SET(static_cast<std::size_t>(cpu), &cpus);
    } else {
      is_possible = false;
    }
    if (!list.empty()) list += ',';
    list += std::to_string(cpu);
  }
  int error = is_possible ? pthread_setaffinity_np(pthread_self(), sizeof cpus, &cpus) : EINVAL;
  // The system silently ignores CPUs that the machine does not have.
  cpu_set_t granted;
  if (error == 0) error = pthread_getaffinity_np(pthread_self(), sizeof granted, &granted);
  if (error == 0 && !CPU_EQUAL(&cpus, &granted)) error = EINVAL;
  if (error == 0) return {};
  return setup_error(subject + " can't be confined to CPU " + list, system_error(error),
                     "name CPUs that this machine has and the process may use (see: nproc, "
                     "taskset -p $$)");
}

int request_level(int level) noexcept {
  sched_param parameter{};
  parameter.sched_priority = level;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter);
}

std::string name_of_level(int level) {
  return "SCHED_FIFO " + std::to_string(level);
}

std::string remedy_of_level(int) {
  return {};
}

SetupError level_refusal(const std::string& subject, int level, int error) {
  rlimit limit{};
  getrlimit(RLIMIT_RTPRIO, &limit);
  const std::error_code cause = system_error(error);
  return {subject + " can't run at " + name_of_level(level) + " (" + cause.message() +
              "; the limit is " + std::to_string(limit.rlim_cur) + ")",
          "its latency is not bounded",
          is_group_without_realtime()
              ? "this kernel (CONFIG_RT_GROUP_SCHED) shares real time out to control groups: give "
                "that of this process (see: /proc/self/cgroup) some cpu.rt_runtime_us, start it "
                "outside of the group or container, or boot a kernel without the option; or say "
                "--realtime off."
              : "give the user the right (a line '<user> - rtprio 90' in "
                "/etc/security/limits.conf, LimitRTPRIO=90 in a systemd unit, or CAP_SYS_NICE), or "
                "say --realtime off.",
          cause};
}

bool yield_to_all() noexcept {
  // On Linux, the "process" 0 is the calling thread.
  constexpr int kNiceLowest = 19;
  return setpriority(PRIO_PROCESS, 0, kNiceLowest) == 0;
}

}  // namespace rtpm::rt::os
