#pragma once

#include <cstdint>

#include "rtpm/base/bytes.hpp"
#include "rtpm/device_hid/report_descriptor.hpp"

/// Functions for reading reports of several kinds of device.
namespace rtpm::device_hid {

[[nodiscard]] inline std::uint8_t byte_at(ConstBytes report, std::size_t index) noexcept {
  return std::to_integer<std::uint8_t>(report[index]);
}

/// Whether the report has `size` bytes, optionally followed by zeros: some devices pad a report to
/// their packet size. Two reports in one read are a fault.
[[nodiscard]] bool has_size(ConstBytes report, std::size_t size) noexcept;

/// Whether a thumb or foot moves this axis only one way from its rest position: a slider, throttle
/// or pedal.
[[nodiscard]] bool goes_one_way(std::uint32_t usage) noexcept;

/// Scales `value` of `field` to -1 to 1, or to 0 to 1 if the axis goes one way; clamped. The
/// field's range must not be empty.
[[nodiscard]] double share_of(const Field& field, std::int64_t value) noexcept;

}  // namespace rtpm::device_hid
