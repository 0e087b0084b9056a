#pragma once

#include <optional>
#include <string>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/security.hpp"

namespace rtpm::media {

/// The options of rtpm-media.
struct Configuration {
  std::string knob = "lab/knob0";
  std::string player = "lab/player0";
  std::string registry{};
  rpc::NodeSecurity security{};
  std::string mode = "speed";   ///< The initial mode: "speed", "scrub" or "frame".
  bool has_fixed_mode = false;  ///< The knob's button does not change the mode.
  double seconds = 0;           ///< 0 to run until a stop signal.
  double rate_hz = 100;
  bool is_headless = false;
  std::string clip{};  ///< Where to write the example's clip; the program then ends.
  Priority priority = 20000;
  Duration patience = std::chrono::seconds{2};

  [[nodiscard]] Duration period() const noexcept {
    return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(1.0 / rate_hz));
  }
};

/// Reads file, environment and flags into `configuration`, like options::Options::parse().
[[nodiscard]] std::optional<int> read_configuration(int argc, const char* const* argv,
                                                    Configuration& configuration);

}  // namespace rtpm::media
