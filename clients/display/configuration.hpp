#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/rpc/security.hpp"

namespace rtpm::display {

/// The options of rtpm-display.
struct Configuration {
  std::vector<std::string> devices{"lab/arm0"};
  std::string events{events::kHubPath};  ///< The hub's name or URL.
  std::string registry{};
  rpc::NodeSecurity security{};
  double seconds = 0;  ///< 0 to run until a stop signal.
  double rate_hz = 10;
  std::string live{};  ///< "rewrite" or "lines".
};

/// Reads file, environment and flags into `configuration`, like options::Options::parse().
[[nodiscard]] std::optional<int> read_configuration(int argc, const char* const* argv,
                                                    Configuration& configuration);

}  // namespace rtpm::display
