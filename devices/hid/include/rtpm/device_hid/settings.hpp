#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/device_hid/profile.hpp"

namespace rtpm::device_hid {

/// An operator's choice of a device.
struct Settings {
  std::optional<Kind> kind{};      ///< Nullopt for the device's own kind.
  std::string serial{};            ///< Empty if any will do.
  std::string node{};              ///< "/dev/hidraw0"; empty if any will do.
  double torque_newton_metre = 0;  ///< Torque of a force wheel's motor; 0 if unknown.
};

/// Reads "kind=gamepad serial=123 node=/dev/hidraw0 torque_newton_metre=5".
/// @errors   an unknown word or kind; a torque that is not a number
[[nodiscard]] expected<Settings, SetupError> read_settings(std::string_view arguments);

/// Identifies a unit after it was plugged in again.
struct Identity {
  std::string serial{};
  std::string port{};
  std::string node{};  ///< Counts only for a unit without serial and port.
};
[[nodiscard]] Identity identity_of(const Unit& unit);

/// The kind as which `settings` select `unit`; nullopt if they do not select it. They may select
/// any joystick as a plain game pad.
[[nodiscard]] std::optional<Kind> kind_for(const Settings& settings, const Unit& unit);

/// The one unit of `units` that is asked for.
/// @param known  if not null, only this unit matches, wherever it is plugged in
/// @return null if it is not plugged in
/// @errors   several units fit, by name
[[nodiscard]] expected<const Unit*, SetupError> choose(const std::vector<Unit>& units,
                                                       const Settings& settings,
                                                       const Identity* known);

}  // namespace rtpm::device_hid
