#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "survey/judgements.hpp"

namespace rtpm::rt {

Finding judge_clock_source(const HostFiles& files) {
  const std::string& clock = files.clock_source;
  if (clock.empty()) return {"clock", Severity::kNote, "the system does not name its clock"};
  constexpr std::array<std::string_view, 4> kQuick{"tsc", "kvm-clock", "arch_sys_counter",
                                                   "hyperv_clocksource_tsc_page"};
  if (std::ranges::find(kQuick, clock) != kQuick.end()) {
    return {"clock", Severity::kGood, "'" + clock + "' is read without a system call"};
  }
  return {"clock", Severity::kWarning, "reading '" + clock + "' takes a system call",
          "up to 1 µs each, several times a call",
          "see why the kernel left the CPU's own counter: sudo dmesg | grep -i tsc"};
}

Finding judge_timers(const HostAnswers& answers) {
  constexpr Duration kResolutionMax = std::chrono::microseconds{1};
  if (answers.timer_resolution <= kResolutionMax) {
    return {"timers", Severity::kGood, "timers are high-resolution"};
  }
  const auto us =
      std::chrono::duration_cast<std::chrono::microseconds>(answers.timer_resolution).count();
  return {"timers", Severity::kProblem, "timers have a resolution of " + std::to_string(us) + " µs",
          "each period and each deadline is that coarse, so 1 kHz is not kept",
          "take highres=off and nohz=off from the kernel's command line"};
}

Finding judge_clock_sync(const HostAnswers& answers) {
  if (answers.is_clock_synchronised) {
    return {"clock-sync", Severity::kGood,
            "the clock is kept within " + std::to_string(answers.clock_error_us) + " µs"};
  }
  return {"clock-sync", Severity::kNote, "no program keeps the clock to a reference",
          "recordings of several hosts are apart by the difference of their clocks, which grows by "
          "some s a day; calls and deadlines are not affected",
          "sudo apt-get install chrony; or ptp4l, for some µs"};
}

}  // namespace rtpm::rt
