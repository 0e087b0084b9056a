#include "rtpm/rt/survey.hpp"

#include "survey/judgements.hpp"

namespace rtpm::rt {

std::string_view to_string(Severity severity) noexcept {
  switch (severity) {
    case Severity::kGood:
      return "good";
    case Severity::kNote:
      return "note";
    case Severity::kWarning:
      return "warning";
    case Severity::kProblem:
      return "problem";
  }
  return "unknown";
}

std::vector<Finding> judge_host(const HostFiles& files, const HostAnswers& answers) {
  return {judge_realtime(answers),
          judge_memory_lock(answers),
          judge_throttling(answers),
          judge_kernel(files),
          judge_machine(files),
          judge_container(files),
          judge_cpus(answers),
          judge_load(files, answers),
          judge_isolation(files),
          judge_interrupts(files),
          judge_irqbalance(files),
          judge_frequency(files),
          judge_idle_states(files, answers),
          judge_clock_source(files),
          judge_timers(answers),
          judge_timer_slack(answers),
          judge_clock_sync(answers),
          judge_socket_buffers(files),
          judge_shared_memory(answers),
          judge_huge_pages(files),
          judge_swap(files, answers)};
}

}  // namespace rtpm::rt
