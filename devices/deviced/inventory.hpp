#pragma once

#include <span>
#include <string>
#include <vector>

#include "drivers.hpp"
#include "rtpm/device_io/found_device.hpp"

/// The output of --list-drivers and --probe.
namespace rtpm::deviced {

/// One line per driver: its name and the devices it supports, or what this build lacks for it.
[[nodiscard]] std::string list_text(std::span<const DriverInfo> drivers);

/// The devices that the probe() functions of the drivers find.
/// @realtime set-up only: queries the hardware
[[nodiscard]] std::vector<device_io::FoundDevice> probe(std::span<const DriverInfo> drivers);

/// One paragraph per device: its model, how to serve it and which permission is missing; then the
/// udev rules that grant the permissions. Text from the devices is escaped.
/// @param drivers  those that looked for devices, named if there are none
[[nodiscard]] std::string probe_text(const std::vector<device_io::FoundDevice>& devices,
                                     std::span<const DriverInfo> drivers);

}  // namespace rtpm::deviced
