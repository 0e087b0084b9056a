#pragma once

#include <span>
#include <string_view>

#include "figures/report.hpp"
#include "settings.hpp"

namespace rtpm::bench {

/// One of rtpm-bench's cases. A case adds its results to the report one by one, and reports the
/// parts that it could not measure.
struct Case {
  std::string_view name;
  std::string_view description;
  void (*run)(const Settings& settings, Report& report);
};

[[nodiscard]] std::span<const Case> cases();

void run_call(const Settings& settings, Report& report);
void run_paced(const Settings& settings, Report& report);
void run_isolation(const Settings& settings, Report& report);
void run_large(const Settings& settings, Report& report);
void run_events(const Settings& settings, Report& report);
void run_ladder(const Settings& settings, Report& report);
void run_throughput(const Settings& settings, Report& report);
void run_two_node(const Settings& settings, Report& report);
void run_device(const Settings& settings, Report& report);
void run_scale(const Settings& settings, Report& report);
void run_startup(const Settings& settings, Report& report);
void run_memory(const Settings& settings, Report& report);
void run_idle(const Settings& settings, Report& report);

}  // namespace rtpm::bench
