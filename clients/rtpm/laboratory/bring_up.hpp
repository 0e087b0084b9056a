#pragma once

#include <optional>

#include "cli/context.hpp"
#include "laboratory/plan.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::tool {

struct BringUpOptions {
  bool is_detached = false;        ///< Returns when everything serves.
  std::optional<Duration> time{};  ///< The laboratory ends after this time.
  bool must_end_before = false;    ///< A laboratory that still runs then has failed.
};

/// Brings a laboratory up and shows it. Ends it on request, or when all its main programs have
/// ended.
/// @threads  before any other thread starts
/// @return the exit code
[[nodiscard]] int bring_up(Context& context, const laboratory::Plan& plan,
                           const BringUpOptions& options);

/// Reports every mistake of a laboratory's file. @return the exit code
[[nodiscard]] int refuse_file(const Context& context, const std::vector<SetupError>& errors);

}  // namespace rtpm::tool
