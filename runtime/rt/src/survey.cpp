#include <fcntl.h>
#include <sys/statvfs.h>
#include <sys/timex.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
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

SetupNote survey_idle_states() {
  const std::string driver = text_in("/sys/devices/system/cpu/cpuidle/current_driver");
  if (driver.empty() || driver == "none") {
    return {"idle states", Grant::kGranted, "the system puts no CPU to sleep", ""};
  }
  // A server that asks for CPU latency keeps its CPUs awake; others wake slowly.
  const std::string text = "'" + driver + "' lets idle CPUs sleep: waking may take some 0.1 ms";
  return {"idle states", Grant::kPartly, text,
          "run servers with --cpu-latency 0s, or cpupower idle-set -D 10."};
}

/// Of a socket's buffer that a large message needs.
constexpr long kSocketBufferMin = 2 * 1024 * 1024;

SetupNote survey_socket_buffers() {
  const std::string text = text_in("/proc/sys/net/core/rmem_max");
  const long size = std::strtol(text.c_str(), nullptr, 10);
  if (size >= kSocketBufferMin) {
    return {"socket buffers", Grant::kGranted, "up to " + text + " bytes", ""};
  }
  return {"socket buffers", Grant::kPartly,
          "at most " + text + " bytes: bursts of UDP datagrams are lost and sent again",
          "sysctl -w net.core.rmem_max=" + std::to_string(kSocketBufferMin) + "."};
}

SetupNote survey_shared_memory() {
  struct statvfs disk {};
  if (::statvfs("/dev/shm", &disk) != 0) {
    return {"shared memory", Grant::kPartly, "there is no /dev/shm",
            "mount -t tmpfs tmpfs /dev/shm."};
  }
  const std::uint64_t size = disk.f_blocks * disk.f_frsize / (1024 * 1024);
  const std::string text = "/dev/shm has " + std::to_string(size) + " MiB";
  constexpr std::uint64_t kSizeMin = 128;  // Docker's default of 64 MiB is soon full.
  if (size >= kSizeMin) return {"shared memory", Grant::kGranted, text, ""};
  return {"shared memory", Grant::kPartly, text + ": it may be full with few servers",
          "give it more (docker run --shm-size=1g)."};
}

SetupNote survey_clock_sync() {
  timex state{};
  const int answer = ::adjtimex(&state);
  if (answer == TIME_ERROR || (state.status & STA_UNSYNC) != 0) {
    return {"clock sync", Grant::kPartly,
            "no program keeps the clock: times of several hosts do not compare in recordings",
            "apt-get install chrony, or run ptp4l."};
  }
  return {"clock sync", Grant::kGranted,
          "the clock is kept within " + std::to_string(state.maxerror) + " us", ""};
}

}  // namespace

std::vector<SetupNote> survey_host() {
  return {survey_scheduling(), survey_throttling(),     survey_memory(),
          survey_latency(),    survey_kernel(),         survey_cpus(),
          survey_frequency(),  survey_idle_states(),    survey_clock(),
          survey_clock_sync(), survey_socket_buffers(), survey_shared_memory()};
}

}  // namespace rtpm::rt
