#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cli/output.hpp"
#include "rtpm/rt/survey.hpp"

namespace rtpm::tool {

/// What `rtpm doctor` shows of findings.
struct FindingReport {
  std::vector<rt::Finding> findings{};
  std::vector<rt::Change> changes{};     ///< Of --fix.
  std::vector<std::string> fixed_ids{};  ///< Findings that are good since then.
  std::vector<std::string> lastings{};   ///< Lines for a shell that make the changes last.
  bool is_dry = false;                   ///< The changes were only printed.
};

/// Lines for people: counts, then what is wrong, the worst first, each with what it costs and its
/// remedy, then what is good.
/// @param shows_all  what is good in a line each, else by its names only
[[nodiscard]] std::string text_of(const std::vector<rt::Finding>& findings, bool shows_all,
                                  std::size_t width);
/// What --fix changed from what to what, and how to make it last; empty: nothing was to change.
[[nodiscard]] std::string text_of_changes(const FindingReport& report);

[[nodiscard]] Json json_of_findings(const FindingReport& report);
[[nodiscard]] Json json_of_changes(const FindingReport& report);

}  // namespace rtpm::tool
