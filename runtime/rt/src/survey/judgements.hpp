#pragma once

#include <string>
#include <vector>

#include "rtpm/rt/finding.hpp"
#include "rtpm/rt/survey.hpp"

// The parts of judge_host(): each function depends on the facts only.
namespace rtpm::rt {

[[nodiscard]] Finding judge_realtime(const HostAnswers& answers);
[[nodiscard]] Finding judge_memory_lock(const HostAnswers& answers);
[[nodiscard]] Finding judge_throttling(const HostAnswers& answers);
[[nodiscard]] Finding judge_timer_slack(const HostAnswers& answers);

[[nodiscard]] Finding judge_kernel(const HostFiles& files);
[[nodiscard]] Finding judge_machine(const HostFiles& files);
[[nodiscard]] Finding judge_container(const HostFiles& files);
[[nodiscard]] Finding judge_cpus(const HostAnswers& answers);
[[nodiscard]] Finding judge_load(const HostFiles& files, const HostAnswers& answers);
[[nodiscard]] Finding judge_isolation(const HostFiles& files);
[[nodiscard]] Finding judge_interrupts(const HostFiles& files);
[[nodiscard]] Finding judge_irqbalance(const HostFiles& files);
[[nodiscard]] Finding judge_frequency(const HostFiles& files);
[[nodiscard]] Finding judge_idle_states(const HostFiles& files, const HostAnswers& answers);

[[nodiscard]] Finding judge_clock_source(const HostFiles& files);
[[nodiscard]] Finding judge_timers(const HostAnswers& answers);
[[nodiscard]] Finding judge_clock_sync(const HostAnswers& answers);

[[nodiscard]] Finding judge_socket_buffers(const HostFiles& files);
[[nodiscard]] Finding judge_shared_memory(const HostAnswers& answers);
[[nodiscard]] Finding judge_huge_pages(const HostFiles& files);
[[nodiscard]] Finding judge_swap(const HostFiles& files, const HostAnswers& answers);

/// The word in brackets of "always [madvise] never"; empty if there is none.
[[nodiscard]] std::string chosen_of(const std::string& text);

}  // namespace rtpm::rt
