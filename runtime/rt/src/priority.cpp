#include "rtpm/rt/priority.hpp"

#include <string>

#include "native_level.hpp"
#include "os/native_thread.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::rt {
namespace {

// Set before threads start.
PriorityMapping priority_mapping = nullptr;

thread_local std::optional<Priority> thread_priority;
// The thread's known SCHED_FIFO level; 0 if only the system knows it.
thread_local int thread_level = 0;

}  // namespace

expected<void, SetupError> set_priority_mapping(PriorityMapping mapping) {
  constexpr int kLevelMax = 98;  // 99 is left to the kernel's own threads.
  int previous = 1;
  for (int value = Priority::kLowest; mapping != nullptr && value <= Priority::kHighest; ++value) {
    const int level = mapping(Priority{value});
    if (level < previous || level > kLevelMax) {
      return setup_error("the priority mapping gives priority " + std::to_string(value) +
                             " level " + std::to_string(level),
                         "",
                         "give each priority a level from 1 to 98, and none a lower one than a "
                         "priority below it");
    }
    previous = level;
  }
  priority_mapping = mapping;
  return {};
}

int level_of(Priority priority) noexcept {
  return priority_mapping != nullptr ? priority_mapping(priority) : to_native(priority);
}

std::optional<Priority> current_priority() noexcept {
  return thread_priority;
}

bool set_current_priority(Priority priority) noexcept {
  thread_priority = priority;
  return set_native_level(level_of(priority));
}

int native_level() noexcept {
  return thread_level;
}

bool set_native_level(int level) noexcept {
  if (thread_level == level) return true;
  if (os::request_level(level) != 0) return false;
  if (thread_level == 0) this_thread_budget() = RealtimeBudget(realtime_limit(), now());
  thread_level = level;
  return true;
}

void note_thread_priority(Priority priority, bool is_fifo) noexcept {
  thread_priority = priority;
  thread_level = is_fifo ? level_of(priority) : 0;
  this_thread_budget() = is_fifo ? RealtimeBudget(realtime_limit(), now()) : RealtimeBudget();
}

void adopt_priority(Priority priority) noexcept {
  thread_priority = priority;
  if (thread_level != 0) set_native_level(level_of(priority));
}

}  // namespace rtpm::rt
