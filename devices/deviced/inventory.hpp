#pragma once

#include <span>
#include <string>
#include <vector>

#include "drivers.hpp"
#include "rtpm/device_io/found_device.hpp"

/// The output of --list-drivers and --probe.
namespace rtpm::deviced {

/// A line per driver: its name and which devices it serves, or what its build lacks.
[[nodiscard]] std::string list_text(std::span<const DriverInfo> drivers);

/// The devices that the drivers' probe() functions find.
/// @realtime set-up only: asks the hardware
[[nodiscard]] std::vector<device_io::FoundDevice> probe(std::span<const DriverInfo> drivers);

/// A paragraph per device: its model, how to serve it, the missing right; then the udev rules that
/// give the rights. The devices' own words are escaped.
[[nodiscard]] std::string probe_text(const std::vector<device_io::FoundDevice>& devices);

}  // namespace rtpm::deviced
