#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "rtpm/base/time.hpp"

/// What the tests of the guest share.
namespace rtpm::vm_test {

/// Software emulation is slow; nothing waits so long when all is well.
inline constexpr Duration kPatience = std::chrono::seconds{10};

/// The node of the HID device with this serial number, "/dev/hidraw0"; empty: there is none.
[[nodiscard]] std::string hidraw_node(const std::string& serial_number);

/// As hidraw_node(), but waits until udev has finished with the device; empty after kPatience.
[[nodiscard]] std::string wait_for_hidraw_node(const std::string& serial_number);

/// Why a test has to skip: this machine has no /dev/uhid or no vhci_hcd. Empty: it has.
[[nodiscard]] std::string missing_uhid();
[[nodiscard]] std::string missing_vhci();

}  // namespace rtpm::vm_test
