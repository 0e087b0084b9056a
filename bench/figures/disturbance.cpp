#include "figures/disturbance.hpp"

#include <sched.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <utility>

#include "rtpm/rt/priority.hpp"

namespace rtpm::bench {
namespace {

namespace fs = std::filesystem;

// Below this a wait is ordinary: a tick, an interrupt, the migration thread. It also tells a stall
// that fell into a timed stretch from one between two of them.
constexpr double kHeldOffMarkMs = 10;
constexpr double kStealMarkPercent = 0.1;

std::string first_line_of(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

/// The value of "key : value" in a file such as /proc/cpuinfo.
std::string value_in(const fs::path& path, const std::string& key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t colon = line.find(':');
    if (colon != std::string::npos && colon + 2 <= line.size()) return line.substr(colon + 2);
  }
  return "unknown";
}

/// Of all CPUs, in ticks.
struct CpuTime {
  std::uint64_t stolen = 0;
  std::uint64_t total = 0;
};

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

bool is_measured_thread(pid_t thread) {
  sched_param parameter{};
  return sched_getscheduler(thread) == SCHED_FIFO && sched_getparam(thread, &parameter) == 0 &&
         parameter.sched_priority >= rt::level_of(kHighPriority);
}

}  // namespace

RoundWatch::RoundWatch(const StallDetector* detector)
    : detector_(detector),
      stolen_time_(detector == nullptr ? std::span<const int>{} : detector->cpus()),
      stolen_(read_cpu_time().stolen),
      stall_count_(detector == nullptr ? 0 : detector->count()) {}

bool RoundWatch::was_disturbed() const {
  return read_cpu_time().stolen != stolen_ || stolen_time_.most() >= kStolenMin ||
         (detector_ != nullptr && detector_->count() != stall_count_);
}

DisturbanceWatch::DisturbanceWatch(std::vector<pid_t> servers) {
  const CpuTime now = read_cpu_time();
  stolen_ = now.stolen;
  total_ = now.total;
  follow(std::move(servers));
}

void DisturbanceWatch::note() {
  noted_ms_ = std::max(noted_ms_, held_off_ms());
}

void DisturbanceWatch::end_round() {
  note();
  run_delays_ = read_run_delays();
}

void DisturbanceWatch::follow(std::vector<pid_t> servers) {
  processes_ = std::move(servers);
  processes_.push_back(getpid());
  run_delays_ = read_run_delays();
}

double DisturbanceWatch::held_off_ms() const {
  double longest_ms = 0;
  for (const auto& [thread, delay] : read_run_delays()) {
    const auto before = run_delays_.find(thread);
    const std::uint64_t grown = delay - (before == run_delays_.end() ? 0 : before->second);
    longest_ms = std::max(longest_ms, static_cast<double>(grown) / 1e6);
  }
  return longest_ms;
}

std::map<pid_t, std::uint64_t> DisturbanceWatch::read_run_delays() const {
  std::map<pid_t, std::uint64_t> delays;
  for (const pid_t process : processes_) {
    std::error_code gone;
    for (const auto& task :
         fs::directory_iterator("/proc/" + std::to_string(process) + "/task", gone)) {
      const pid_t thread = std::stoi(task.path().filename().string());
      if (!is_measured_thread(thread)) continue;
      std::istringstream line(first_line_of(task.path() / "schedstat"));
      std::uint64_t ran_ns = 0;
      line >> ran_ns >> delays[thread];
    }
  }
  return delays;
}

void DisturbanceWatch::finish(Result& result, double longest_us) const {
  const CpuTime now = read_cpu_time();
  const std::uint64_t total = now.total - total_;
  const double steal_percent =
      total == 0 ? 0
                 : 100.0 * static_cast<double>(now.stolen - stolen_) / static_cast<double>(total);
  const double longest_ms = std::max(noted_ms_, held_off_ms());
  result.json.add("steal_percent", steal_percent);
  result.json.add("held_off_ms", longest_ms);
  if (steal_percent >= kStealMarkPercent) {
    result.marks.push_back("the hypervisor took " + short_text(steal_percent) +
                           " % of the CPU time away: mistrust the tail");
  }
  if (longest_ms >= kHeldOffMarkMs && longest_us >= kHeldOffMarkMs * 1000 / 2) {
    result.marks.push_back(
        "a real-time thread waited " + short_text(longest_ms) +
        " ms for its CPU: real-time throttling (kernel.sched_rt_runtime_us) or a more urgent "
        "thread; mistrust the tail");
  }
}

Environment describe_environment(const Placement& placement, bool is_realtime) {
  utsname kernel{};
  uname(&kernel);
  const std::string cpu = value_in("/proc/cpuinfo", "model name");
  const bool is_virtual =
      value_in("/proc/cpuinfo", "flags").find(" hypervisor") != std::string::npos;
  std::string governor = first_line_of("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
  if (governor.empty()) governor = "unknown";
  const auto cpu_count = static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN));

  Environment environment;
  environment.json.add("cpu", cpu);
  environment.json.add("cpu_count", cpu_count);
  environment.json.add("virtualised", is_virtual);
  environment.json.add("kernel", std::string_view(kernel.release));
  environment.json.add("governor", governor);
  environment.json.add("sched_rt_runtime_us",
                       std::string_view(first_line_of("/proc/sys/kernel/sched_rt_runtime_us")));
  environment.json.add("client_cpu", placement.client_cpu);
  environment.json.add("server_cpu", placement.server_cpu);
  environment.json.add("realtime", is_realtime);
  environment.json.add("compiler", __VERSION__);
  environment.json.add("build", RTPM_BENCH_BUILD);
  environment.text =
      cpu + ", " + std::to_string(cpu_count) + " CPUs" + (is_virtual ? ", virtualised" : "") +
      "; Linux " + kernel.release + "; callers on CPU " + std::to_string(placement.client_cpu) +
      ", servers on CPU " + std::to_string(placement.server_cpu) +
      (is_realtime ? ", SCHED_FIFO" : ", time-shared") + "; built as " + RTPM_BENCH_BUILD;
  return environment;
}

}  // namespace rtpm::bench
