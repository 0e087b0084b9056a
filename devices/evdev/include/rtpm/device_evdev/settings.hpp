#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_evdev/layout.hpp"
#include "rtpm/device_evdev/transport.hpp"

namespace rtpm::device_evdev {

/// An operator's choice of a device, and the properties of it that the kernel does not know.
struct Settings {
  std::string serial{};
  std::string path{};
  std::string node{};
  std::string name{};
  bool is_grabbed = false;
  double gain = 1;  ///< Scales all effects, 0 to 1.
  Scales scales{};

  /// Whether the settings choose a device; otherwise the only joystick is meant.
  [[nodiscard]] bool names_one() const noexcept {
    return !(serial.empty() && path.empty() && node.empty() && name.empty());
  }
};

/// Reads "serial=A1 gain=0.5 name=Racing Wheel"; `name` takes the rest of the words.
/// @errors   an unknown word, a number outside of its range, in words
[[nodiscard]] expected<Settings, SetupError> read_settings(std::string_view words);

/// The unit that `settings` means. Among several matches it takes the only joystick, as game pads
/// have further nodes for their motion sensors.
/// @param known  the unit as it was found before: finds the same one again, by its serial number
///               otherwise by its port, also at another node
/// @errors   no unit matches, or several are alike, in words
[[nodiscard]] expected<Unit, SetupError> choose(std::span<const Unit> units,
                                                const Settings& settings,
                                                const std::optional<Unit>& known);

}  // namespace rtpm::device_evdev
