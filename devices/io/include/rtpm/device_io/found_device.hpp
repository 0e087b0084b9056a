#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace rtpm::device_io {

/// The file for a udev rule.
inline constexpr const char* kUdevRulesFile = "/etc/udev/rules.d/70-rtpm.rules";

/// A device that a driver's probe() found on this machine. The device's own words are not escaped.
struct FoundDevice {
  std::string driver{};         ///< The driver that takes it: "hid".
  std::string model{};          ///< "3Dconnexion SpaceNavigator".
  std::string serial{};         ///< Empty if it has none.
  std::string node{};           ///< The node to open: "/dev/hidraw0".
  std::string arguments{};      ///< Make the driver take this one: "node=/dev/hidraw0".
  std::string missing_right{};  ///< See missing_right(); empty if this process may open it.
  std::string udev_rule{};      ///< Gives the right to the user at the machine.
  std::string left_out{};       ///< The device's controls beside its channels; may be empty.
  std::string refusal{};        ///< Why the driver does not take it; empty if it does.
};

/// The right that this process lacks to read and write `node`: "reading and writing /dev/hidraw0",
/// "/dev/hidraw0, which is gone". Empty if it has the right.
/// @realtime set-up only
[[nodiscard]] std::string missing_right(const std::string& node);

/// The udev rule that gives the nodes of a USB device to the user at the machine.
/// @param subsystem  the node's: "usb", "hidraw", "tty", "input"
/// @realtime set-up only
/// @source   systemd's manual pages udev(7) and sd-login(3), the tag uaccess
[[nodiscard]] std::string udev_rule(std::string_view subsystem, std::uint16_t vendor,
                                    std::uint16_t product);

/// The remedy for a device that this user may not open: how to install its rule.
/// @realtime set-up only
[[nodiscard]] std::string rule_remedy(const std::string& udev_rule);

}  // namespace rtpm::device_io
