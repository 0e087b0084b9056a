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

/// Judges a host's fitness for real-time programs: facts first, then judgements that depend only on
/// them.
namespace rtpm::rt {

/// The frequency scaling of a CPU.
struct FrequencyFacts {
  std::string path{};      ///< The governor's file.
  std::string governor{};  ///< "powersave".
};

/// A sleep state of an idle CPU.
struct IdleStateFacts {
  std::string name{};      ///< "C6".
  Duration wake_time{0};   ///< The time to leave it, as the system states it.
  bool is_enabled = true;  ///< Whether it is enabled on at least one CPU.
};

/// An interrupt that has a handler.
struct InterruptFacts {
  int number = 0;
  std::string name{};
  std::vector<int> cpus{};                ///< The CPUs that may handle it.
  std::map<int, std::uint64_t> counts{};  ///< How often each CPU handled it, if ever.
};

/// Facts from the system's files.
struct HostFiles {
  bool is_realtime_kernel = false;
  bool is_virtual_machine = false;
  std::string container{};                    ///< Its kind, such as "docker"; empty outside of one.
  std::string clock_source{};                 ///< "tsc"; empty if unknown.
  std::vector<FrequencyFacts> frequencies{};  ///< One for each CPU that has a governor.
  std::string idle_driver{};                  ///< "intel_idle"; empty if there is none.
  std::vector<IdleStateFacts> idle_states{};  ///< The states of all CPUs, without duplicates.
  std::vector<int> online_cpus{};
  std::vector<int> isolated_cpus{};  ///< As configured by isolcpus or a cpuset partition.
  std::vector<int> tickless_cpus{};  ///< As configured by nohz_full.
  std::vector<int> pinned_cpus{};    ///< CPUs that real-time threads are confined to.
  std::vector<InterruptFacts> interrupts{};
  bool has_irqbalance = false;             ///< Whether irqbalance runs.
  std::optional<std::int64_t> rmem_max{};  ///< The maximum size of a socket's buffers, in bytes.
  std::optional<std::int64_t> wmem_max{};
  /// How many threads ran or wanted to run, on average over the last minute; nullopt if unknown.
  std::optional<double> load{};
  std::string huge_pages{};  ///< Such as "always", "madvise", "never"; empty if there are none.
  std::uint64_t swap_kib = 0;
};

/// Facts from system calls.
struct HostAnswers {
  std::optional<SetupError> realtime_refusal{};     ///< nullopt if granted.
  std::optional<SetupError> memory_lock_refusal{};  ///< nullopt if granted.
  std::optional<SetupError> cpu_latency_refusal{};  ///< nullopt if granted.
  bool is_group_without_realtime = false;  ///< The control group allows no real-time threads.
  RealtimeLimit realtime_limit{};
  int usable_cpu_count = 1;
  Duration timer_resolution{0};
  Duration timer_slack{0};  ///< How late a time-shared thread's sleep may end.
  bool is_clock_synchronised = false;
  std::int64_t clock_error_us = 0;
  /// Bytes of /dev/shm; nullopt if there is none.
  std::optional<std::uint64_t> shared_memory_size{};
  std::uint64_t shared_memory_free = 0;  ///< Bytes.
};

/// Reads the facts from the files below `root`; "" is the system's root.
/// @param process_ids  the processes whose real-time threads count for `pinned_cpus`
/// @realtime set-up only
[[nodiscard]] HostFiles read_host(const std::string& root, const std::vector<int>& process_ids);

/// Makes the same requests to the system as RTPM does. Locks the process's memory.
/// @realtime set-up only
[[nodiscard]] HostAnswers ask_host();

/// Judges the facts for real-time programs: a finding for each subject, in a fixed order.
/// @realtime set-up only
[[nodiscard]] std::vector<Finding> judge_host(const HostFiles& files, const HostAnswers& answers);

/// Judges this host, like judge_host(). Locks the process's memory.
/// @realtime set-up only
[[nodiscard]] std::vector<Finding> survey_host(const std::vector<int>& process_ids = {});

/// A change that apply() made to a file.
struct Change {
  std::string path;
  std::string from;
  std::string to;
  std::string problem{};  ///< Why the change failed; empty if it was made, or would be.
};

/// Writes a setting, and reads it back. nullopt if the file already has the value.
/// @param is_dry  only report what would be written
/// @realtime set-up only
[[nodiscard]] std::optional<Change> apply(const Setting& setting, bool is_dry);

}  // namespace rtpm::rt
