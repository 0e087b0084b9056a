#pragma once

#include <cstdint>

#include "rtpm/base/bytes.hpp"
#include "rtpm/device_hid/report_descriptor.hpp"

/// Functions with which several kinds of device read a report.
namespace rtpm::device_hid {

[[nodiscard]] inline std::uint8_t byte_at(ConstBytes report, std::size_t index) noexcept {
  return std::to_integer<std::uint8_t>(report[index]);
}

/// Whether the report has `size` bytes, and after them at most zeros: some devices pad a report to
/// their packet, while two reports in one read are a fault.
[[nodiscard]] bool has_size(ConstBytes report, std::size_t size) noexcept;

/// Whether a thumb or foot moves this axis one way from its rest: a slider, throttle or pedal.
[[nodiscard]] bool goes_one_way(std::uint32_t usage) noexcept;

/// `value` of `field` as -1 to 1, or as 0 to 1 if it goes one way; clamped. The field's
/// range is not empty.
[[nodiscard]] double share_of(const Field& field, std::int64_t value) noexcept;

}  // namespace rtpm::device_hid
