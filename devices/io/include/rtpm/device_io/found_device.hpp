#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace rtpm::device_io {

/// Where a udev rule goes.
inline constexpr const char* kUdevRulesFile = "/etc/udev/rules.d/70-rtpm.rules";

/// A device that a driver's probe() found on this machine. The device's own words are not escaped.
struct FoundDevice {
  std::string driver{};         ///< That takes it: "hid".
  std::string model{};          ///< "3Dconnexion SpaceNavigator".
  std::string serial{};         ///< Empty: it has none.
  std::string node{};           ///< Which is opened: "/dev/hidraw0".
  std::string arguments{};      ///< For the driver, so that it takes this one: "node=/dev/hidraw0".
  std::string missing_right{};  ///< As missing_right() says; empty: this process may open it.
  std::string udev_rule{};      ///< That gives the right to the user at the machine.
  std::string left_out{};       ///< The device's controls beside its channels; may be empty.
  std::string refusal{};        ///< Why the driver does not take it; empty: it does.
};

/// The right that this process lacks to read and write `node`: "reading and writing /dev/hidraw0",
/// "/dev/hidraw0, which is gone"; empty: it has the right.
/// @realtime set-up only
[[nodiscard]] std::string missing_right(const std::string& node);

/// The udev rule that gives the nodes of a USB device to the user at the machine.
/// @param subsystem  of the node: "usb", "hidraw", "tty", "input"
/// @realtime set-up only
/// @source   systemd's manual pages udev(7) and sd-login(3), the tag uaccess
[[nodiscard]] std::string udev_rule(std::string_view subsystem, std::uint16_t vendor,
                                    std::uint16_t product);

/// For the error of a device that this user may not open: what to do with its rule.
/// @realtime set-up only
[[nodiscard]] std::string rule_remedy(const std::string& udev_rule);

}  // namespace rtpm::device_io
