#include "sides/standalone.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <ctime>
#include <fstream>
#include <sstream>

#include "rtpm/rt/native_time.hpp"
#include "sides/floor.hpp"
#include "sides/rtpm_side.hpp"

namespace rtpm::bench {
namespace {

expected<std::string, std::string> set_up(Standalone which, const Settings& settings) {
  const rt::WaitConfig wait{.strategy = settings.waits.front()};
  const int cpu = choose_placement().server_cpu;
  if (which == Standalone::kRtpm) {
    return start_rtpm_server(
        {.lanes = {{.name = "rtpm-high", .priority = kHighPriority, .wait = wait, .cpus = {cpu}}},
         .realtime = settings.realtime});
  }
  const auto ports = start_floor_server(
      settings.carriers.front(),
      {{.name = "floor-high", .priority = kHighPriority, .wait = wait, .cpu = cpu}},
      settings.realtime);
  if (!ports) return unexpected{ports.error()};
  return std::to_string(ports->front());
}

}  // namespace

std::optional<Standalone> standalone_of(std::string_view text) noexcept {
  if (text == "rtpm") return Standalone::kRtpm;
  if (text == "floor") return Standalone::kFloor;
  return std::nullopt;
}

int serve_standalone(Standalone which, const Settings& settings) {
  const auto address = set_up(which, settings);
  std::printf("%s", (address ? "+" + *address : "-" + address.error()).c_str());
  std::fflush(stdout);
  if (!address) return 1;
  // The starter reads up to the end of file. The descriptor stays in use, by /dev/null.
  const int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (nothing < 0 || dup2(nothing, STDOUT_FILENO) < 0) return 1;
  for (;;)
    ::pause();
}

expected<ServerProcess, std::string> start_standalone(Standalone which, Carrier carrier,
                                                      rt::WaitStrategy wait,
                                                      const Settings& settings) {
  const std::string realtime = settings.realtime == rt::RealtimeMode::kOff ? "off" : "prefer";
  return ServerProcess::start_program({"/proc/self/exe", "serve",
                                       which == Standalone::kRtpm ? "rtpm" : "floor", "--transport",
                                       std::string(to_string(carrier)), "--wait",
                                       std::string(rt::to_string(wait)), "--realtime", realtime});
}

std::uint16_t floor_port(const std::string& address) {
  return static_cast<std::uint16_t>(std::stoi(address));
}

MemoryUse memory_of(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/smaps_rollup");
  MemoryUse use;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string name;
    double kib = 0;
    words >> name >> kib;
    if (name == "Rss:") use.resident_mib = kib / 1024;
    if (name == "Pss:") use.proportional_mib = kib / 1024;
  }
  return use;
}

Duration cpu_time_of(pid_t process) {
  clockid_t clock{};
  timespec time{};
  if (clock_getcpuclockid(process, &clock) != 0) return Duration{0};
  if (clock_gettime(clock, &time) != 0) return Duration{0};
  return rt::to_duration(time);
}

}  // namespace rtpm::bench
