#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cli/output.hpp"
#include "rtpm/rt/survey.hpp"

namespace rtpm::tool {

/// The contents of `rtpm doctor`'s report.
struct FindingReport {
  std::vector<rt::Finding> findings{};
  std::vector<rt::Change> changes{};     ///< The changes of --fix.
  std::vector<std::string> fixed_ids{};  ///< Findings that these changes fixed.
  std::vector<std::string> lastings{};   ///< Shell lines that make the changes permanent.
  bool is_dry = false;                   ///< The changes were only printed.
};

/// Lines for users: counts, then the problems, most serious first, each with its cost and remedy,
/// then the good findings.
/// @param shows_all  shows each good finding in its own line; otherwise only their names
[[nodiscard]] std::string text_of(const std::vector<rt::Finding>& findings, bool shows_all,
                                  std::size_t width);
/// The changes made by --fix, with old and new values, and how to make them permanent; empty if
/// none.
[[nodiscard]] std::string text_of_changes(const FindingReport& report);

[[nodiscard]] Json json_of_findings(const FindingReport& report);
[[nodiscard]] Json json_of_changes(const FindingReport& report);

}  // namespace rtpm::tool
