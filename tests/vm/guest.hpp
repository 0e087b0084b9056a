#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "rtpm/base/time.hpp"
#include "rtpm/rt/clock.hpp"

/// The helpers that the tests of the guest share.
namespace rtpm::vm_test {

/// Software emulation is slow; in a good run no wait takes that long.
inline constexpr Duration kPatience = std::chrono::seconds{10};

/// Waits until `is_so()`; false after kPatience. It pauses for long between two checks: each costs
/// the emulated CPU some milliseconds of the host's time, while a pause costs none.
template <class Condition>
[[nodiscard]] bool await(Condition is_so) {
  constexpr Duration kPause = std::chrono::milliseconds{10};
  const MonotonicTime end = rt::now() + kPatience;
  while (!is_so()) {
    if (rt::now() >= end) return false;
    rt::sleep_until(rt::now() + kPause);
  }
  return true;
}

/// The node of the HID device with this serial number, "/dev/hidraw0"; empty if there is none.
[[nodiscard]] std::string hidraw_node(const std::string& serial_number);

/// Like hidraw_node(), but waits until udev has finished with the device; empty after kPatience.
[[nodiscard]] std::string wait_for_hidraw_node(const std::string& serial_number);

/// Why a test has to skip: this machine lacks /dev/uhid or vhci_hcd. Empty if it has both.
[[nodiscard]] std::string missing_uhid();
[[nodiscard]] std::string missing_vhci();

}  // namespace rtpm::vm_test
