#pragma once

#include <sys/types.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "figures/report.hpp"
#include "figures/samples.hpp"
#include "figures/stall_detector.hpp"
#include "figures/stolen_time.hpp"
#include "settings.hpp"

namespace rtpm::bench {

/// Detects whether the machine stood still in the round measured since construction: the
/// hypervisor took CPU time away (steal), or a detector counted a stall.
/// @threads   one
/// @realtime  set-up only: reads /proc, and with a detector visits its CPUs
class RoundWatch {
 public:
  /// What matters to a p99.9 that is some tenths of a millisecond.
  static constexpr Duration kStolenMin = std::chrono::microseconds{300};

  /// Reads steal from /proc/stat, in hundredths of a second. With a detector, to which it refers,
  /// also counts that detector's stalls and kStolenMin taken from one of its CPUs.
  explicit RoundWatch(const StallDetector* detector = nullptr);
  [[nodiscard]] bool was_disturbed() const;

 private:
  const StallDetector* detector_;
  StolenTime stolen_time_;
  std::uint64_t stolen_;
  std::uint64_t stall_count_ = 0;
};

/// Watches, over a run, what spoils figures and is nobody's fault: time that a hypervisor took away
/// (steal), and real-time threads that had to wait for their CPU all the same, which is what the
/// kernel's real-time throttling looks like from inside.
/// Threads: one.   Set-up only: it reads /proc, so outside of timed stretches.
class DisturbanceWatch {
 public:
  /// Watches the machine, this process and `servers` from now on.
  explicit DisturbanceWatch(std::vector<pid_t> servers);

  /// Notes what the servers met so far, which are about to end.
  void note();
  /// Notes the same at the end of each of a run's rounds, of which the longest counts. Else the
  /// ordinary waits of a thousand wake-ups add up to what looks like one long one.
  void end_round();
  /// Watches other servers, which take the place of those noted.
  void follow(std::vector<pid_t> servers);

  /// What happened since: fields steal_percent and held_off_ms, and a mark for each that matters to
  /// a result whose longest latency is `longest_us`.
  void finish(Result& result, double longest_us) const;

 private:
  /// Nanoseconds that each measured real-time thread waited, ready to run, for a CPU.
  [[nodiscard]] std::map<pid_t, std::uint64_t> read_run_delays() const;
  /// The longest that a thread waited since follow() or end_round(), in milliseconds.
  [[nodiscard]] double held_off_ms() const;

  std::vector<pid_t> processes_;
  std::uint64_t stolen_ = 0;  ///< Ticks of all CPUs, as the total is.
  std::uint64_t total_ = 0;
  std::map<pid_t, std::uint64_t> run_delays_;
  double noted_ms_ = 0;
};

/// The machine as far as it matters for latencies, for the JSON and in words.
struct Environment {
  JsonObject json;
  std::string text;
};
[[nodiscard]] Environment describe_environment(const Placement& placement, bool is_realtime);

}  // namespace rtpm::bench
