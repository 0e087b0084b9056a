#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "rtpm/base/time.hpp"

namespace rtpm::test {

/// The CPU time that this process has used.
[[nodiscard]] Duration process_cpu_time();

/// Blocks the calling thread by the system's own call.
void block_for(Duration time);

/// The system's scheduling of the calling thread.
struct Scheduling {
  int level = 0;  ///< Its relative priority.
  static constexpr int policy = 0;
  friend bool operator==(Scheduling, Scheduling) = default;
  friend void PrintTo(Scheduling scheduling, std::ostream* out) {
    *out << "priority " << scheduling.level;
  }
};
inline constexpr Scheduling kTimeShared{};

[[nodiscard]] Scheduling scheduling_of_this_thread();

/// The system's number of the calling thread.
[[nodiscard]] int number_of_this_thread();
[[nodiscard]] std::string name_of_this_thread();

[[nodiscard]] std::vector<int> cpus_of_this_thread();

/// Every user may have the priorities that RTPM uses.
[[nodiscard]] constexpr bool has_realtime_right() noexcept {
  return true;
}
inline constexpr const char* kNoRealtimeRight = "no right to real-time priorities here";

}  // namespace rtpm::test
