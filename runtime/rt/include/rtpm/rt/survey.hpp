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

/// A host's fitness for real-time programs: facts first, then judgements that depend on them only.
namespace rtpm::rt {

/// The frequency scaling of a CPU.
struct FrequencyFacts {
  std::string path{};      ///< The governor's file.
  std::string governor{};  ///< "powersave".
};

/// A state in which an idle CPU sleeps.
struct IdleStateFacts {
  std::string name{};      ///< "C6".
  Duration wake_time{0};   ///< The time to leave it, by the system's own figure.
  bool is_enabled = true;  ///< On at least one CPU.
};

/// An interrupt that has a handler.
struct InterruptFacts {
  int number = 0;
  std::string name{};
  std::vector<int> cpus{};                ///< The CPUs that may handle it.
  std::map<int, std::uint64_t> counts{};  ///< How often each CPU did, if ever.
};

/// The facts that are read from the system's files.
struct HostFiles {
  bool is_realtime_kernel = false;
  bool is_virtual_machine = false;
  std::string clock_source{};                 ///< "tsc"; empty if unknown.
  std::vector<FrequencyFacts> frequencies{};  ///< One for each CPU that has a governor.
  std::string idle_driver{};                  ///< "intel_idle"; empty if there is none.
  std::vector<IdleStateFacts> idle_states{};  ///< The states of all CPUs, each once.
  std::vector<int> online_cpus{};
  std::vector<int> isolated_cpus{};  ///< By isolcpus or a cpuset's partition.
  std::vector<int> tickless_cpus{};  ///< By nohz_full.
  std::vector<int> pinned_cpus{};    ///< CPUs that real-time threads are confined to.
  std::vector<InterruptFacts> interrupts{};
  bool has_irqbalance = false;             ///< It runs.
  std::optional<std::int64_t> rmem_max{};  ///< Bytes of a socket's buffers.
  std::optional<std::int64_t> wmem_max{};
  /// How many threads ran or wanted to, on average over the last minute; nullopt if unknown.
  std::optional<double> load{};
  std::string huge_pages{};  ///< "always", "madvise", "never"; empty if there are none.
  std::uint64_t swap_kib = 0;
};

/// The facts that system calls return.
struct HostAnswers {
  std::optional<SetupError> realtime_refusal{};     ///< nullopt: granted.
  std::optional<SetupError> memory_lock_refusal{};  ///< nullopt: granted.
  std::optional<SetupError> cpu_latency_refusal{};  ///< nullopt: granted.
  bool is_group_without_realtime = false;           ///< The control group allows none.
  RealtimeLimit realtime_limit{};
  int usable_cpu_count = 1;
  Duration timer_resolution{0};
  Duration timer_slack{0};  ///< How late a time-shared thread's sleep may end.
  bool is_clock_synchronised = false;
  std::int64_t clock_error_us = 0;
  std::optional<std::uint64_t>
      shared_memory_size{};              ///< Bytes of /dev/shm; nullopt if there is none.
  std::uint64_t shared_memory_free = 0;  ///< Bytes.
};

/// Reads the facts from the files below `root`, "" being the system's own.
/// @param process_ids  whose real-time threads count for `pinned_cpus`
/// @realtime set-up only
[[nodiscard]] HostFiles read_host(const std::string& root, const std::vector<int>& process_ids);

/// Makes the same requests to the system as RTPM does. Locks the memory of the process.
/// @realtime set-up only
[[nodiscard]] HostAnswers ask_host();

/// Judges the facts for real-time programs: a finding for each subject, in a fixed order.
/// @realtime set-up only
[[nodiscard]] std::vector<Finding> judge_host(const HostFiles& files, const HostAnswers& answers);

/// Judges this host as judge_host() does. Locks the memory of the process.
/// @realtime set-up only
[[nodiscard]] std::vector<Finding> survey_host(const std::vector<int>& process_ids = {});

/// The change that apply() made to a file.
struct Change {
  std::string path;
  std::string from;
  std::string to;
  std::string problem{};  ///< Why it was not made; empty if it was, or would be.
};

/// Writes a setting, and reads it back. nullopt if the file has the value already.
/// @param is_dry  only reports what would be written
/// @realtime set-up only
[[nodiscard]] std::optional<Change> apply(const Setting& setting, bool is_dry);

}  // namespace rtpm::rt
