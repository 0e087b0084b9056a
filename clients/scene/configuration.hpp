#pragma once

#include <optional>
#include <string>

#include "rtpm/events/defaults.hpp"
#include "rtpm/rpc/security.hpp"

namespace rtpm::scene {

/// The options of rtpm-scene.
struct Configuration {
  std::string device = "lab/arm0";
  std::string events{events::kHubPath};  ///< The hub's name or URL.
  std::string registry{};
  rpc::NodeSecurity security{};
  double seconds = 0;  ///< 0 to run until a stop signal.
  double rate_hz = 60;
  std::string live = "rewrite";  ///< "rewrite", "lines" or "off".
  std::string picture{};         ///< An SVG file to write; empty if there is none.
};

/// Reads file, environment and flags into `configuration`, like options::Options::parse().
[[nodiscard]] std::optional<int> read_configuration(int argc, const char* const* argv,
                                                    Configuration& configuration);

}  // namespace rtpm::scene
