#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/gvd/device.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/options/server_options.hpp"

namespace rtpm::deviced {

/// The options of rtpm-deviced.
struct Configuration {
  std::string name = "lab/arm0";
  std::string device = "sim";
  std::string hand{};    ///< A recorded hand; empty: PressingPath.
  bool is_free = false;  ///< No hand holds the arm.
  std::uint64_t seed = 1;
  double rate_hz = 1000;
  options::ServerSettings settings{};  ///< Its server's.
  std::string registry{};
  bool allows_takeover = false;  ///< Of its name, from a live server.
  Priority device_priority = 30000;
  double force_max_newton = 0;  ///< 0: the device's limit.
  Duration hold_max = std::chrono::milliseconds{100};
  Duration ramp = std::chrono::milliseconds{20};
  Duration soft_start = std::chrono::milliseconds{200};
  gvd::LeaseConfig lease{};
  Priority operator_priority = gvd::CycleConfig{}.operator_priority;
};

/// The registry's URL that stands for "serve without a registry".
inline constexpr const char* kNoRegistry = "none";

/// Reads file, environment and flags into `configuration`; as options::Options::parse().
[[nodiscard]] std::optional<int> read_configuration(int argc, const char* const* argv,
                                                    Configuration& configuration);

}  // namespace rtpm::deviced
