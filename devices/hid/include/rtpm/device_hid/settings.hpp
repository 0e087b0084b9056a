#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/device_hid/profile.hpp"

namespace rtpm::device_hid {

/// The operator's choice of a device.
struct Settings {
  std::optional<Kind> kind{};      ///< Nullopt to detect the kind.
  std::string serial{};            ///< Empty if any serial number matches.
  std::string node{};              ///< For example "/dev/hidraw0"; empty if any node matches.
  double torque_newton_metre = 0;  ///< Torque of the motor of a force wheel; 0 if unknown.
};

/// Parses "kind=gamepad serial=123 node=/dev/hidraw0 torque_newton_metre=5".
/// @errors   an unknown word or kind; a torque that is not a number
[[nodiscard]] expected<Settings, SetupError> read_settings(std::string_view arguments);

/// Identifies a unit that is unplugged and plugged in again.
struct Identity {
  std::string serial{};
  std::string port{};
  std::string node{};  ///< Compared only for a unit without serial number and port.
};
[[nodiscard]] Identity identity_of(const Unit& unit);

/// The kind with which `settings` select `unit`; nullopt if they do not select it. They may select
/// any joystick as a plain game pad.
[[nodiscard]] std::optional<Kind> kind_for(const Settings& settings, const Unit& unit);

/// Finds the one unit in `units` that the settings select.
/// @param known  if not null, only this unit matches, on any port
/// @return null if the unit is not plugged in
/// @errors   several units match; the text names them
[[nodiscard]] expected<const Unit*, SetupError> choose(const std::vector<Unit>& units,
                                                       const Settings& settings,
                                                       const Identity* known);

}  // namespace rtpm::device_hid
