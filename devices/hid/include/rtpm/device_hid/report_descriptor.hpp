#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"

/// A HID device's description of its reports.
/// @source   USB "Device Class Definition for HID" 1.11, section 6.2.2
namespace rtpm::device_hid {

/// Usages as page and number: 0x0001'0030 is X of the desktop page.
inline constexpr std::uint32_t kDesktopPage = 0x0001'0000;
inline constexpr std::uint32_t kSimulationPage = 0x0002'0000;
inline constexpr std::uint32_t kButtonPage = 0x0009'0000;

/// One number of an input report.
/// @ownership plain value
struct Field {
  std::uint32_t usage = 0;        ///< Page and number.
  std::uint32_t application = 0;  ///< Usage of the application collection around it.
  std::uint8_t report_id = 0;     ///< 0 if the device numbers no reports.
  std::uint32_t bit_offset = 0;   ///< From the start of the report, its number included.
  std::uint8_t bit_size = 0;      ///< 1 to 32.
  std::int64_t logical_low = 0;
  std::int64_t logical_high = 0;
  bool is_relative = false;
  bool has_null = false;  ///< Values outside of the logical range say "none".
};

/// Fields that are not in ReportDescriptor::inputs: on other pages, in arrays, with more than 32
/// bits, or beyond kFieldCountMax.
/// @ownership plain value
struct UnreadFields {
  std::uint32_t application = 0;
  std::uint32_t page = 0;  ///< The usage page; a maker's own from 0xff00'0000 on.
  std::uint32_t count = 0;
};

/// @ownership a value
struct ReportDescriptor {
  /// Variable fields of up to 32 bits on the pages above, in their order; at most kFieldCountMax.
  std::vector<Field> inputs{};
  /// One entry per application and page; at most kUnreadCountMax.
  std::vector<UnreadFields> unread{};
  bool has_report_ids = false;
  /// Bytes of the input report of each number, the number included; 0 if there is no such report.
  std::array<std::uint16_t, 256> input_sizes{};
};

inline constexpr std::size_t kDescriptorSizeMax = 4096;  ///< The limit of Linux.
inline constexpr std::size_t kFieldCountMax = 512;
inline constexpr std::size_t kUnreadCountMax = 64;

/// Reads a report descriptor. Foreign data: any bytes give a descriptor or an error. Accepts what
/// Linux accepts; unread fields take their space only.
/// @errors   the fault, as a clause
/// @source   Linux, drivers/hid/hid-core.c
[[nodiscard]] expected<ReportDescriptor, std::string> parse_report_descriptor(ConstBytes bytes);

/// The value of `field` in `report`, sign-extended where its range goes below zero; nullopt if
/// the report is another one, or too short.
/// @realtime alloc-free
[[nodiscard]] std::optional<std::int64_t> value_of(const Field& field, ConstBytes report) noexcept;

}  // namespace rtpm::device_hid
