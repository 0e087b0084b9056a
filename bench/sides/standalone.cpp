#include "sides/standalone.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <ctime>
#include <fstream>
#include <string>

#include "rtpm/rt/native_time.hpp"
#include "sides/floor.hpp"
#include "sides/rtpm_side.hpp"

namespace rtpm::bench {
namespace {

Outcome<std::string> set_up(Side side, const Settings& settings) {
  const rt::WaitConfig wait{.strategy = settings.waits.front()};
  const int cpu = choose_placement().server_cpu;
  if (side == Side::kRtpm) {
    return start_rtpm_server(
        {.lanes = {{.name = "rtpm-high", .priority = kHighPriority, .wait = wait, .cpus = {cpu}}},
         .realtime = settings.realtime});
  }
  const auto ports = start_floor_server(
      settings.carriers.front(),
      {{.name = "floor-high", .priority = kHighPriority, .wait = wait, .cpu = cpu}},
      settings.realtime);
  if (!ports) return failure(ports.error());
  return std::to_string(ports->front());
}

}  // namespace

int serve_standalone(Side side, const Settings& settings) {
  const auto address = set_up(side, settings);
  std::printf("%s", (address ? "+" + *address : "-" + address.error()).c_str());
  std::fflush(stdout);
  if (!address) return 1;
  // The starter reads up to the end of file. The descriptor stays in use, by /dev/null.
  const int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (nothing < 0 || dup2(nothing, STDOUT_FILENO) < 0) return 1;
  for (;;)
    ::pause();
}

Outcome<ServerProcess> start_standalone(Side side, Carrier carrier, rt::WaitStrategy wait,
                                        const Settings& settings) {
  return ServerProcess::start_program(
      {"/proc/self/exe", "serve", side == Side::kRtpm ? "rtpm" : "floor", "--transport",
       std::string(to_string(carrier)), "--wait", std::string(rt::to_string(wait)), "--realtime",
       settings.realtime == rt::RealtimeMode::kOff ? "off" : "prefer"});
}

double resident_mib_of(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/smaps_rollup");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("Rss:")) return std::stod(line.substr(4)) / 1024;
  }
  return 0;
}

Duration cpu_time_of(pid_t process) {
  clockid_t clock{};
  timespec time{};
  if (clock_getcpuclockid(process, &clock) != 0) return Duration{0};
  if (clock_gettime(clock, &time) != 0) return Duration{0};
  return rt::to_duration(time);
}

}  // namespace rtpm::bench
