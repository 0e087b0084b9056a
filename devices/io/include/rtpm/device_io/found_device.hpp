#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace rtpm::device_io {

/// The file in which to install a udev rule.
inline constexpr const char* kUdevRulesFile = "/etc/udev/rules.d/70-rtpm.rules";

/// A device that a driver's probe() found on this machine. Text from the device is not escaped.
struct FoundDevice {
  std::string driver{};  ///< The driver that supports it, such as "hid".
  std::string model{};   ///< For example "3Dconnexion SpaceNavigator".
  std::string serial{};  ///< Empty if it has none.
  std::string node{};    ///< The node to open, such as "/dev/hidraw0".
  /// Driver arguments that select this device, such as "node=/dev/hidraw0".
  std::string arguments{};
  /// The result of missing_right(); empty if this process may open the device.
  std::string missing_right{};
  /// Grants the permission to the user at the machine. Empty on Windows.
  std::string udev_rule{};
  std::string left_out{};  ///< The device's controls without a channel; may be empty.
  std::string refusal{};   ///< The reason why the driver does not support it; empty if it does.
};

/// The permission to read and write `node` that this process lacks: "reading and writing
/// /dev/hidraw0", "/dev/hidraw0, which is gone", on Windows "reading and writing NODE, which another
/// program holds". Empty if it has the permission.
/// @realtime set-up only
[[nodiscard]] std::string missing_right(const std::string& node);

/// The udev rule that lets the user at the machine open the nodes of a USB device. Empty on Windows,
/// where every user may.
/// @param subsystem  the node's subsystem: "usb", "hidraw", "tty", "input"
/// @realtime set-up only
/// @source   systemd's manual pages udev(7) and sd-login(3), the tag uaccess
[[nodiscard]] std::string udev_rule(std::string_view subsystem, std::uint16_t vendor,
                                    std::uint16_t product);

/// The remedy for a device that this user may not open: how to install the rule; on Windows, which
/// programs may hold the device.
/// @realtime set-up only
[[nodiscard]] std::string rule_remedy(const std::string& udev_rule);

}  // namespace rtpm::device_io
