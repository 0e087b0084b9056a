#include <string>

#include "setup_text.hpp"
#include "survey/judgements.hpp"

// Judges the rights that the system grants the process.
namespace rtpm::rt {
namespace {

// A line for the user to paste. Limits are set when a session starts.
std::string limit_line(const std::string& limit) {
  return "echo \"$USER - " + limit + "\" | sudo tee -a /etc/security/limits.d/90-rtpm.conf\n" +
         "then log in again; in a systemd unit: ";
}

}  // namespace

Finding judge_realtime(const HostAnswers& answers) {
  if (!answers.realtime_refusal) {
    return {"realtime", Severity::kGood, "threads may run at SCHED_FIFO up to 89"};
  }
  const std::string remedy =
      answers.is_group_without_realtime
          ? answers.realtime_refusal->remedy
          : limit_line("rtprio 90") + "LimitRTPRIO=90; in a container: " + "--cap-add SYS_NICE";
  return {"realtime", Severity::kProblem, answers.realtime_refusal->what,
          "any busy program delays a call, by some ms for each that shares the CPU; nothing bounds "
          "it",
          remedy};
}

Finding judge_memory_lock(const HostAnswers& answers) {
  if (!answers.memory_lock_refusal) {
    return {"memory-lock", Severity::kGood, "all memory can be locked"};
  }
  const std::string what = answers.memory_lock_refusal->what;
  return {"memory-lock", Severity::kProblem, what.substr(0, what.find("): ") + 1),
          "a page that the system took away costs a real-time thread some µs, from a disk some ms",
          limit_line("memlock unlimited") +
              "LimitMEMLOCK=infinity; in a container: " + "--ulimit memlock=-1"};
}

Finding judge_throttling(const HostAnswers& answers) {
  const RealtimeLimit limit = answers.realtime_limit;
  if (!limit.is_limited()) {
    return {"throttling", Severity::kGood, "real-time threads may use all of a CPU"};
  }
  const auto ms = [](Duration time) {
    return std::to_string(std::chrono::duration_cast<std::chrono::milliseconds>(time).count());
  };
  // RTPM's own threads pause before the kernel throttles them (budget.hpp).
  return {"throttling", Severity::kNote, throttling_text(limit),
          "RTPM's threads pause 0.1 ms at a time before that; other real-time threads that never "
          "block stop them with themselves, for " +
              ms(limit.period - limit.runtime) + " ms of each " + ms(limit.period) + " ms",
          "if each real-time thread of this host is known to block by itself:\n"
          "sudo sysctl -w kernel.sched_rt_runtime_us=-1"};
}

Finding judge_timer_slack(const HostAnswers& answers) {
  const auto us =
      std::chrono::duration_cast<std::chrono::microseconds>(answers.timer_slack).count();
  const std::string text = "a time-shared thread's sleep ends up to " + std::to_string(us) +
                           " µs late by the system's choice";
  constexpr Duration kSlackMax = std::chrono::microseconds{50};  // The kernel's default.
  if (answers.realtime_refusal && us > 0) {
    return {"timer-slack", Severity::kNote, text,
            "without the right to SCHED_FIFO, that much jitter in each period",
            "see realtime: a thread at SCHED_FIFO has no slack"};
  }
  if (answers.timer_slack > kSlackMax) {
    return {"timer-slack", Severity::kWarning, text,
            "time-shared lanes and tools wake that much later",
            "start the program from a shell or unit that did not raise it (systemd: "
            "TimerSlackNSec=50us)"};
  }
  return {"timer-slack", Severity::kGood, text + "; real-time threads have no slack"};
}

}  // namespace rtpm::rt
