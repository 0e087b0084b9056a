#include "os/native_thread.hpp"

#include <pthread.h>
#include <sched.h>

// Not run yet: written from Apple's headers and manual pages.
namespace rtpm::rt::os {
namespace {

// Threads of programs may use 15 to 47; from 32 on they are above the usual ones, which have 31.
constexpr int kLowest = 32;
constexpr int kHighest = 47;

int native(int level) noexcept {
  constexpr int kLevelMax = 98;
  return kLowest + (kHighest - kLowest) * (level - 1) / (kLevelMax - 1);
}

}  // namespace

void name_this_thread(const std::string& name) noexcept {
  pthread_setname_np(name.substr(0, 63).c_str());
}

expected<void, SetupError> confine_this_thread(const std::string& subject,
                                               const std::vector<int>&) {
  return setup_error(subject + " can't be confined to CPUs", "macOS has no such right",
                     "leave the CPUs out");
}

int request_level(int level) noexcept {
  sched_param parameter{};
  parameter.sched_priority = native(level);
  return pthread_setschedparam(pthread_self(), SCHED_RR, &parameter);
}

std::string name_of_level(int level) {
  return "SCHED_RR " + std::to_string(native(level));
}

std::string remedy_of_level(int) {
  return {};
}

SetupError level_refusal(const std::string& subject, int level, int error) {
  const std::error_code cause = system_error(error);
  return {subject + " can't run at " + name_of_level(level) + " (" + cause.message() + ")",
          "its latency is not bounded", "say --realtime off.", cause};
}

bool yield_to_all() noexcept {
  return pthread_set_qos_class_self_np(QOS_CLASS_BACKGROUND, 0) == 0;
}

}  // namespace rtpm::rt::os
