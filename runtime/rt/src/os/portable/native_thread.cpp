#include "os/native_thread.hpp"

#include <pthread.h>
#include <sched.h>

namespace rtpm::rt::os {

// POSIX names no threads.
void name_this_thread(const std::string&) noexcept {}

expected<void, SetupError> confine_this_thread(const std::string& subject,
                                               const std::vector<int>&) {
  return setup_error(subject + " can't be confined to CPUs", "this system has no such right",
                     "leave the CPUs out");
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
  const std::error_code cause = system_error(error);
  return {subject + " can't run at " + name_of_level(level) + " (" + cause.message() + ")",
          "its latency is not bounded",
          "give the user the right to real-time scheduling, or say --realtime off.", cause};
}

bool yield_to_all() noexcept {
  return false;
}

}  // namespace rtpm::rt::os
