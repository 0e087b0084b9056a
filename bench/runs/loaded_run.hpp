#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "figures/disturbance.hpp"
#include "figures/report.hpp"
#include "rtpm/rt/thread.hpp"
#include "runs/duel.hpp"
#include "settings.hpp"
#include "sides/low_load.hpp"

namespace rtpm::bench {

/// With what callers of low priority load a server while one of high priority is measured.
struct LoadPlan {
  std::string case_name;
  std::string field;   ///< Of a result's JSON, for how many callers of low priority there were.
  std::string people;  ///< "low-priority caller", with an s for several.
  std::vector<int> caller_counts;  ///< Measured one after the other; 0 besides, unreported.
  /// Makes the jobs of a side whose turn it is, as many as the most callers.
  std::function<expected<std::vector<Job>, std::string>(Duel& duel, Side side)> connect;
  /// The load goes to RTPM's server, whichever side is measured.
  bool is_load_on_rtpm = false;
  /// Both CPUs are kept awake, with the load and without. Else a load that leaves them no sleep
  /// makes the measured caller quicker, and hides what it costs him.
  bool keeps_awake = false;
  /// What the load's latencies are compared with; 0: with nothing.
  Duration work{0};
};

/// Keeps CPUs from sleeping, with threads that yield to all others (SCHED_IDLE).
/// Threads: one.   Set-up only.
class AwakeCpus {
 public:
  AwakeCpus() = default;
  ~AwakeCpus();
  [[nodiscard]] expected<void, std::string> start(const Placement& placement);
  AwakeCpus(const AwakeCpus&) = delete;
  AwakeCpus& operator=(const AwakeCpus&) = delete;

 private:
  std::atomic<bool> is_over_{false};
  std::vector<rt::Thread> threads_;
};

/// A caller of high priority that calls at a fixed rate, once on an idle server and once under each
/// load, RTPM and the raw floor by turns.
class LoadedRun {
 public:
  /// Refers to all that it is given.
  LoadedRun(const Settings& settings, const DuelConfig& config, const LoadPlan& plan, Duel& duel);

  /// On a thread as run_as_caller() has it.
  [[nodiscard]] expected<void, std::string> measure(DisturbanceWatch& watch);
  /// One result per number of callers.
  [[nodiscard]] std::vector<Result> results() const;

 private:
  /// What one side showed under one load.
  struct Finding {
    Samples high;
    Samples low;
  };
  using Level = std::array<Finding, 2>;  ///< By Side.
  /// One side's connections: the measured caller and the low-priority ones.
  struct Connections {
    std::unique_ptr<Caller> high;
    std::unique_ptr<LowLoad> low;
  };

  [[nodiscard]] expected<void, std::string> connect(Side side);
  [[nodiscard]] expected<void, std::string> measure_turn(Side side, int caller_count);
  [[nodiscard]] expected<void, std::string> measure_level(int caller_count, int round);
  [[nodiscard]] bool is_asked(int caller_count) const;
  [[nodiscard]] Result result_of(int caller_count) const;
  void add_growth(Result& result, Side side, std::string_view prefix, const Level& level) const;
  void add_load(Result& result, Side side, std::string_view prefix, const Samples& low) const;

  const Settings& settings_;
  const DuelConfig& config_;
  const LoadPlan& plan_;
  Duel& duel_;
  int round_count_ = 0;
  std::size_t count_per_round_ = 0;  ///< Of each side, in its one turn.
  StallDetector detector_;
  std::map<int, Level> levels_;
  std::array<Connections, 2> connections_;
};

/// Starts a duel, runs the plan in it, and reports what it found.
[[nodiscard]] expected<void, std::string> measure_loaded(const Settings& settings,
                                                         const DuelConfig& config,
                                                         const LoadPlan& plan, Report& report);

}  // namespace rtpm::bench
