#include "figures/disturbance.hpp"

#include <sys/utsname.h>
#include <unistd.h>

#include <fstream>
#include <sstream>

namespace rtpm::bench {
namespace {

constexpr double kStealMarkPercent = 0.1;

std::string first_line_of(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

/// The value of "key : value" in a file such as /proc/cpuinfo.
std::string value_in(const std::string& path, const std::string& key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t colon = line.find(':');
    if (colon != std::string::npos && colon + 2 <= line.size()) return line.substr(colon + 2);
  }
  return "unknown";
}

}  // namespace

CpuTime read_cpu_time() {
  std::istringstream line(first_line_of("/proc/stat"));
  std::string name;
  line >> name;
  CpuTime time;
  // user nice system idle iowait irq softirq steal
  for (int field = 0; field < 8; ++field) {
    std::uint64_t ticks = 0;
    line >> ticks;
    time.total += ticks;
    if (field == 7) time.stolen = ticks;
  }
  return time;
}

void add_steal(Json& result, const CpuTime& before) {
  const CpuTime now = read_cpu_time();
  const auto stolen = static_cast<double>(now.stolen - before.stolen);
  const auto total = static_cast<double>(now.total - before.total);
  const double percent = total == 0 ? 0 : 100 * stolen / total;
  result["steal_percent"] = rounded(percent);
  if (percent < kStealMarkPercent) return;
  add_mark(result, "the hypervisor took " + short_text(percent) +
                       " % of the CPU time away: mistrust the tail");
}

RoundWatch::RoundWatch(const StallDetector& detector)
    : detector_(detector),
      stolen_time_(detector.cpus()),
      stolen_(read_cpu_time().stolen),
      stall_count_(detector.count()) {}

bool RoundWatch::was_disturbed() const {
  return read_cpu_time().stolen != stolen_ || stolen_time_.most() >= kStolenMin ||
         detector_.count() != stall_count_;
}

Json describe_environment(const Placement& placement, bool is_realtime) {
  utsname kernel{};
  uname(&kernel);
  const bool is_virtual =
      value_in("/proc/cpuinfo", "flags").find(" hypervisor") != std::string::npos;
  const std::string governor =
      first_line_of("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
  return {{"cpu", value_in("/proc/cpuinfo", "model name")},
          {"cpu_count", sysconf(_SC_NPROCESSORS_ONLN)},
          {"virtualised", is_virtual},
          {"kernel", kernel.release},
          {"governor", governor.empty() ? "unknown" : governor},
          {"sched_rt_runtime_us", first_line_of("/proc/sys/kernel/sched_rt_runtime_us")},
          {"client_cpu", placement.client_cpu},
          {"server_cpu", placement.server_cpu},
          {"realtime", is_realtime},
          {"compiler", __VERSION__},
          {"build", RTPM_BENCH_BUILD}};
}

}  // namespace rtpm::bench
