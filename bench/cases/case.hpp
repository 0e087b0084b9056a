#pragma once

#include <span>
#include <string>
#include <string_view>

#include "figures/report.hpp"
#include "rtpm/base/expected.hpp"
#include "settings.hpp"

namespace rtpm::bench {

/// What rtpm-bench can run. A case adds its results to the report one by one and says on standard
/// error what it could not measure; it gives back whether it measured everything asked.
struct Case {
  std::string_view name;
  std::string_view description;
  bool (*run)(const Settings& settings, Report& report);
};

[[nodiscard]] std::span<const Case> cases();

bool run_call(const Settings& settings, Report& report);
bool run_paced(const Settings& settings, Report& report);
bool run_isolation(const Settings& settings, Report& report);
bool run_large(const Settings& settings, Report& report);
bool run_events(const Settings& settings, Report& report);
bool run_throughput(const Settings& settings, Report& report);
bool run_two_node(const Settings& settings, Report& report);
bool run_device(const Settings& settings, Report& report);
bool run_scale(const Settings& settings, Report& report);
bool run_startup(const Settings& settings, Report& report);
bool run_memory(const Settings& settings, Report& report);
bool run_ladder(const Settings& settings, Report& report);
bool run_idle(const Settings& settings, Report& report);

}  // namespace rtpm::bench
