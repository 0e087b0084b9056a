#pragma once

#include <span>
#include <string_view>

#include "figures/report.hpp"
#include "runs/duel.hpp"
#include "settings.hpp"

namespace rtpm::bench {

/// One of rtpm-bench's cases.
struct Case {
  std::string_view name;
  std::string_view description;
  /// Several servers, or lanes, run on a CPU at a time: none of them may spin.
  bool shares_cpu;
  /// Measures one carrier and wait strategy, and adds the results to the report one by one.
  Outcome<> (*measure)(const Settings& settings, const DuelConfig& config, Report& report);
};

[[nodiscard]] std::span<const Case> cases();

/// Measures a case with each carrier and wait strategy that was asked for; the report says which
/// could not be measured.
void run_case(const Case& each, const Settings& settings, Report& report);

using Measure = Outcome<>(const Settings& settings, const DuelConfig& config, Report& report);
Measure measure_calls, measure_paced, measure_isolation, measure_two_node, measure_scale;
Measure measure_events, measure_throughput, measure_device;
Measure measure_startup, measure_memory, measure_idle;

}  // namespace rtpm::bench
