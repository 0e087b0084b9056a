#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <string>

#include "file_text.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/cpu_latency.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/priority.hpp"
#include "rtpm/rt/report.hpp"
#include "rtpm/rt/thread.hpp"
#include "setup_text.hpp"

// What the host gives: each question is asked in the way in which RTPM asks it.
namespace rtpm::rt {
namespace {

std::string text_in(const char* path) {
  std::array<char, 256> buffer{};
  return std::string(read_file(path, buffer));
}

SetupNote refused(std::string subject, const SetupError& error) {
  return {std::move(subject), Grant::kRefused, error.reason(), error.remedy};
}

SetupNote survey_scheduling() {
  const auto thread = Thread::start({.name = "rtpm-survey",
                                     .priority = Priority{Priority::kHighest},
                                     .realtime = RealtimeMode::kRequire},
                                    [] {});
  if (!thread) return refused("real-time", thread.error());
  return {"real-time", Grant::kGranted,
          "threads may run at SCHED_FIFO up to " + std::to_string(kNativeHighest), ""};
}

SetupNote survey_throttling() {
  const RealtimeLimit limit = realtime_limit();
  if (!limit.is_limited()) {
    return {"throttling", Grant::kGranted, "real-time threads may use all of a CPU", ""};
  }
  return {"throttling", Grant::kPartly, throttling_text(limit), throttling_remedy()};
}

SetupNote survey_memory() {
  if (auto locked = lock_memory(RealtimeMode::kRequire); !locked) {
    return refused("memory lock", locked.error());
  }
  return {"memory lock", Grant::kGranted, "all memory can be locked", ""};
}

SetupNote survey_latency() {
  const auto request = CpuLatencyRequest::open(Duration{0}, RealtimeMode::kRequire);
  if (!request) return refused("CPU latency", request.error());
  return {"CPU latency", Grant::kGranted, "CPUs can be kept from deep sleep", ""};
}

SetupNote survey_clock() {
  const std::string clock =
      text_in("/sys/devices/system/clocksource/clocksource0/current_clocksource");
  if (clock.empty()) return {"clock", Grant::kNotAsked, "the system does not name it", ""};
  for (const char* quick :
       {"tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page"}) {
    if (clock == quick) {
      return {"clock", Grant::kGranted, "'" + clock + "' is read without a system call", ""};
    }
  }
  return {"clock", Grant::kPartly,
          "reading '" + clock + "' takes a system call, several of which are in each call",
          "see why the kernel left the CPU's own counter (dmesg | grep -i tsc)."};
}

SetupNote survey_frequency() {
  const std::string governor = text_in("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
  if (governor.empty()) {
    return {"frequency", Grant::kGranted, "the system does not change that of the CPUs", ""};
  }
  if (governor == "performance") {
    return {"frequency", Grant::kGranted, "the governor is 'performance'", ""};
  }
  return {"frequency", Grant::kPartly,
          "the governor is '" + governor + "': a CPU that was idle begins slowly",
          "cpupower frequency-set -g performance."};
}

SetupNote survey_cpus() {
  const int count = usable_cpu_count();
  const std::string isolated = text_in("/sys/devices/system/cpu/isolated");
  std::string text = std::to_string(count) + (count == 1 ? " CPU is" : " CPUs are") + " usable";
  text += isolated.empty() ? "; none is isolated from other work" : "; isolated: " + isolated;
  if (count == 1) {
    return {"CPUs", Grant::kPartly, text + "; nothing can spin, so waits block",
            "give the process a second CPU."};
  }
  return {"CPUs", Grant::kGranted, text, ""};
}

SetupNote survey_kernel() {
  if (text_in("/sys/kernel/realtime") == "1") {
    return {"kernel", Grant::kGranted, "it is a real-time kernel (PREEMPT_RT)", ""};
  }
  return {"kernel", Grant::kPartly,
          "it is not a real-time kernel: its own work may delay real-time threads",
          "install linux-image-rt-amd64, where the tail matters."};
}

}  // namespace

std::vector<SetupNote> survey_host() {
  return {survey_scheduling(), survey_throttling(), survey_memory(),    survey_latency(),
          survey_kernel(),     survey_cpus(),       survey_frequency(), survey_clock()};
}

}  // namespace rtpm::rt
