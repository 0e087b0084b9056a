#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/finding.hpp"

/// What a host gives to real-time programs: facts first, then judgements that depend on them only.
namespace rtpm::rt {

/// What the system lets a CPU do with its clock.
struct FrequencyFacts {
  std::string path{};      ///< Of its governor's file.
  std::string governor{};  ///< "powersave".
};

/// A state in which an idle CPU sleeps.
struct IdleStateFacts {
  std::string name{};      ///< "C6".
  Duration wake_time{0};   ///< To leave it, as the system states.
  bool is_enabled = true;  ///< On some CPU.
};

/// An interrupt that has a handler.
struct InterruptFacts {
  int number = 0;
  std::string name{};
  std::vector<int> cpus{};                ///< Which may handle it.
  std::map<int, std::uint64_t> counts{};  ///< How often each CPU did, if ever.
};

/// What is read from the system's files.
struct HostFiles {
  bool is_realtime_kernel = false;
  bool is_virtual_machine = false;
  std::string clock_source{};                 ///< "tsc"; empty: not told.
  std::vector<FrequencyFacts> frequencies{};  ///< Of each CPU that has a governor.
  std::string idle_driver{};                  ///< "intel_idle"; empty: none.
  std::vector<IdleStateFacts> idle_states{};  ///< Of all CPUs.
  std::vector<int> online_cpus{};
  std::vector<int> isolated_cpus{};  ///< By isolcpus or a cpuset's partition.
  std::vector<int> tickless_cpus{};  ///< By nohz_full.
  std::vector<int> pinned_cpus{};    ///< To which real-time threads are confined.
  std::vector<InterruptFacts> interrupts{};
  bool has_irqbalance = false;             ///< It runs.
  std::optional<std::int64_t> rmem_max{};  ///< Bytes of a socket's buffers.
  std::optional<std::int64_t> wmem_max{};
  /// How many threads ran or wanted to, on average over the last minute; nullopt: not told.
  std::optional<double> load{};
  std::string huge_pages{};  ///< "always", "madvise", "never"; empty: none.
  std::uint64_t swap_kib = 0;
};

/// What the system answers when it is asked.
struct HostAnswers {
  std::optional<SetupError> realtime_refusal{};     ///< nullopt: granted.
  std::optional<SetupError> memory_lock_refusal{};  ///< nullopt: granted.
  std::optional<SetupError> cpu_latency_refusal{};  ///< nullopt: granted.
  bool is_group_without_realtime = false;           ///< No thread of the control group may have it.
  RealtimeLimit realtime_limit{};
  int usable_cpu_count = 1;
  Duration timer_resolution{0};
  Duration timer_slack{0};  ///< How late a time-shared thread's sleep may end.
  bool is_clock_synchronised = false;
  std::int64_t clock_error_us = 0;
  std::optional<std::uint64_t>
      shared_memory_size{};              ///< Bytes of /dev/shm; nullopt: there is none.
  std::uint64_t shared_memory_free = 0;  ///< Bytes.
};

/// Reads what the files below `root` tell, "" being the system's own.
/// @param process_ids  whose real-time threads count for `pinned_cpus`
/// @realtime set-up only
[[nodiscard]] HostFiles read_host(const std::string& root, const std::vector<int>& process_ids);

/// Asks the system the way in which RTPM asks it. Locks the memory of the process.
/// @realtime set-up only
[[nodiscard]] HostAnswers ask_host();

/// What the facts mean for real-time programs: a finding for each subject, in a fixed order.
/// @realtime set-up only
[[nodiscard]] std::vector<Finding> judge_host(const HostFiles& files, const HostAnswers& answers);

/// As judge_host(), of this host. Locks the memory of the process.
/// @realtime set-up only
[[nodiscard]] std::vector<Finding> survey_host(const std::vector<int>& process_ids = {});

/// What apply() did to a file.
struct Change {
  std::string path;
  std::string from;
  std::string to;
  std::string problem{};  ///< Why it was not made; empty: it was, or would be.
};

/// Writes a setting, and reads it back. A file that has the value already gives no change.
/// @param is_dry  only says what would be written
/// @realtime set-up only
[[nodiscard]] std::optional<Change> apply(const Setting& setting, bool is_dry);

}  // namespace rtpm::rt
