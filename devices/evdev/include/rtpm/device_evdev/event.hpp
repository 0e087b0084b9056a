#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/time.hpp"

/// Event types and codes are the kernel's numbers.
/// @source   linux/input-event-codes.h
namespace rtpm::device_evdev {

/// One event, as read from the kernel.
/// @ownership plain value
struct Event {
  MonotonicTime time{};
  std::uint16_t type = 0;
  std::uint16_t code = 0;
  std::int32_t value = 0;
};

/// The kernel's description of an absolute axis. Untrusted: the minimum may be greater than the
/// maximum.
struct AbsoluteAxis {
  std::uint16_t code = 0;
  std::int32_t minimum = 0;
  std::int32_t maximum = 0;
  std::int32_t flat = 0;        ///< Values this close to the centre count as the centre.
  std::int32_t resolution = 0;  ///< Counts per unit; 0 if unknown.
  std::int32_t value = 0;       ///< The value when the device was opened.

  friend bool operator==(const AbsoluteAxis&, const AbsoluteAxis&) = default;
};

/// The capabilities of an input device, read when it was opened.
struct Capabilities {
  std::string name;
  std::vector<AbsoluteAxis> absolute{};
  std::vector<std::uint16_t> relative{};
  std::vector<std::uint16_t> keys{};
  std::vector<std::uint16_t> pressed{};  ///< The keys that were pressed when the device was opened.
  std::vector<std::uint16_t> force_feedback{};  ///< FF_RUMBLE, FF_GAIN, …
  int effect_count = 0;           ///< How many effects the device can store at a time.
  bool is_accelerometer = false;  ///< INPUT_PROP_ACCELEROMETER.
};

}  // namespace rtpm::device_evdev
