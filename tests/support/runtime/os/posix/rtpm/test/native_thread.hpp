#pragma once

#include <pthread.h>
#include <sched.h>
#include <unistd.h>

#include <array>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::test {

/// The CPU time that this process has used.
[[nodiscard]] inline Duration process_cpu_time() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return rt::to_duration(time);
}

/// Blocks the calling thread by the system's own call.
inline void block_for(Duration time) {
  const timespec pause = rt::to_timespec(time);
  clock_nanosleep(CLOCK_MONOTONIC, 0, &pause, nullptr);
}

/// The system's scheduling of the calling thread.
struct Scheduling {
  int policy = 0;
  int level = 0;
  friend bool operator==(Scheduling, Scheduling) = default;
  friend void PrintTo(Scheduling scheduling, std::ostream* out) {
    *out << (scheduling.policy == SCHED_FIFO ? "FIFO " : "policy ")
         << (scheduling.policy == SCHED_FIFO ? scheduling.level : scheduling.policy);
  }
};
inline constexpr Scheduling kTimeShared{SCHED_OTHER, 0};
[[nodiscard]] constexpr Scheduling fifo(int level) noexcept {
  return {SCHED_FIFO, level};
}

[[nodiscard]] inline Scheduling scheduling_of_this_thread() {
  Scheduling scheduling;
  sched_param parameter{};
  pthread_getschedparam(pthread_self(), &scheduling.policy, &parameter);
  scheduling.level = parameter.sched_priority;
  return scheduling;
}

/// The system's number of the calling thread.
[[nodiscard]] inline int number_of_this_thread() {
  return gettid();
}
[[nodiscard]] inline std::string name_of_this_thread() {
  std::array<char, 16> name{};
  pthread_getname_np(pthread_self(), name.data(), name.size());
  return name.data();
}

/// The threads of this process whose names begin with `begin`.
[[nodiscard]] inline std::vector<pid_t> threads_named(std::string_view begin) {
  std::vector<pid_t> found;
  std::error_code gone;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task", gone)) {
    std::string name;
    std::getline(std::ifstream(task.path() / "comm"), name);
    if (name.starts_with(begin)) found.push_back(std::stoi(task.path().filename()));
  }
  return found;
}

[[nodiscard]] inline std::vector<int> cpus_of_this_thread() {
  cpu_set_t set;
  CPU_ZERO(&set);
  pthread_getaffinity_np(pthread_self(), sizeof set, &set);
  std::vector<int> cpus;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &set)) cpus.push_back(cpu);
  }
  return cpus;
}

/// The SCHED_FIFO level at which thread `id` runs at this moment, including a level inherited from
/// a waiter; 0 or less if it is time-shared.
[[nodiscard]] inline int effective_level(pid_t id) {
  std::ifstream file("/proc/self/task/" + std::to_string(id) + "/stat");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  // Behind the name in parentheses, which may contain anything, the priority is the 16th word.
  std::istringstream words(text.substr(text.rfind(')') + 1));
  std::string word;
  for (int i = 0; i < 16; ++i)
    words >> word;
  return -std::stoi(word) - 1;
}

/// Whether threads of this process may run at SCHED_FIFO up to RTPM's highest level.
[[nodiscard]] inline bool has_realtime_right() {
  bool has_right = false;
  std::thread([&] {
    sched_param parameter{};
    parameter.sched_priority = 89;
    has_right = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter) == 0;
  }).join();
  return has_right;
}
inline constexpr const char* kNoRealtimeRight =
    "no right to SCHED_FIFO here: run as root, with CAP_SYS_NICE, or with an rtprio limit of 90";

}  // namespace rtpm::test
