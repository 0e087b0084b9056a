#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_evdev/layout.hpp"
#include "rtpm/device_evdev/transport.hpp"

namespace rtpm::device_evdev {

/// The operator's choice of a device, and properties of it that the kernel does not report.
struct Settings {
  std::string serial{};
  std::string path{};
  std::string node{};
  std::string name{};
  bool is_grabbed = false;
  double gain = 1;  ///< Scales all effects, 0 to 1.
  Scales scales{};

  /// Whether the settings select a device; otherwise the machine's only joystick is used.
  [[nodiscard]] bool names_one() const noexcept {
    return !(serial.empty() && path.empty() && node.empty() && name.empty());
  }
};

/// Parses "serial=A1 gain=0.5 name=Racing Wheel"; `name` includes all following words.
/// @errors   an unknown word, an out-of-range number; described in words
[[nodiscard]] expected<Settings, SetupError> read_settings(std::string_view words);

/// The unit that `settings` select. If several match, the only joystick among them is chosen,
/// because game pads have additional nodes for motion sensors.
/// @param known  the unit found before: the same unit is found again by its serial number,
///           otherwise by its port, even if its node has changed
/// @errors   no unit matches, or several can't be told apart; described in words
[[nodiscard]] expected<Unit, SetupError> choose(std::span<const Unit> units,
                                                const Settings& settings,
                                                const std::optional<Unit>& known);

}  // namespace rtpm::device_evdev
