#pragma once

#include <optional>
#include <string>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/security.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/rt/wait.hpp"
#include "wall.hpp"

namespace rtpm::servo {

/// The options of rtpm-servo.
struct Configuration {
  std::string device = "lab/arm0";
  std::string registry{};
  rpc::NodeSecurity security{};
  /// The name below which the wall's parameters are served, or "none".
  std::string serve = "none";
  std::string events = "none";        ///< The hub for the touches, by name or URL, or "none".
  double seconds = 10;                ///< 0 to run until a stop signal.
  std::uint64_t cycle_count_max = 0;  ///< 0 for no limit.
  double rate_hz = 1000;
  Priority priority = 24000;
  Wall wall{.face_m = 0, .stiffness_newton_per_m = 0, .damping_newton_s_per_m = 0.5};
  std::string scene = "plane";    ///< "plane", "sphere" or "texture".
  std::string render = "remote";  ///< "remote" or "local".
  Duration delay{0};              ///< Artificial one-way delay of the link; remote walls only.
  Duration hold = std::chrono::milliseconds{10};
  Duration deadline = std::chrono::milliseconds{10};
  Duration patience = std::chrono::seconds{1};
  bool is_recovery = false;
  std::string live = "rewrite";  ///< "rewrite", "lines" or "off".
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  rt::WaitConfig wait{};

  [[nodiscard]] bool is_serving() const noexcept { return serve != "none"; }
  [[nodiscard]] bool is_publishing() const noexcept { return events != "none"; }
  [[nodiscard]] bool is_local() const noexcept { return render == "local"; }
  [[nodiscard]] Duration period() const noexcept {
    return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(1.0 / rate_hz));
  }
};

/// Reads file, environment and flags into `configuration`, like options::Options::parse().
[[nodiscard]] std::optional<int> read_configuration(int argc, const char* const* argv,
                                                    Configuration& configuration);

/// Longest Configuration::delay.
inline constexpr Duration kDelayMax = std::chrono::milliseconds{100};

/// The stiffest wall with this damping that stays passive on this device as configured, in N/m; 0
/// if there is none.
/// @realtime set-up only
[[nodiscard]] double stiffness_bound_of(const Configuration& configuration,
                                        const driver::Descriptor& device,
                                        double damping_newton_s_per_m);

/// The wall for this device, rendered as configured; without a configured stiffness, three quarters
/// of the bound.
/// @realtime set-up only
/// @errors   a device without force along an axis that the scene needs; a stiffness above the
///           bound, which the text names; a local scene other than the plane
[[nodiscard]] expected<Wall, SetupError> choose_wall(const Configuration& configuration,
                                                     const driver::Descriptor& device);

}  // namespace rtpm::servo
