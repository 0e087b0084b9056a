#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"

/// The description of its reports that a HID device provides.
/// @source   USB "Device Class Definition for HID" 1.11, section 6.2.2
namespace rtpm::device_hid {

/// Usages consist of page and number: 0x0001'0030 is X on the desktop page.
inline constexpr std::uint32_t kDesktopPage = 0x0001'0000;
inline constexpr std::uint32_t kSimulationPage = 0x0002'0000;
inline constexpr std::uint32_t kButtonPage = 0x0009'0000;

/// One number in an input report.
/// @ownership plain value
struct Field {
  std::uint32_t usage = 0;        ///< Consists of page and number.
  std::uint32_t application = 0;  ///< Usage of the enclosing application collection.
  std::uint8_t report_id = 0;     ///< 0 if the device does not number its reports.
  std::uint32_t bit_offset = 0;   ///< From the start of the report, including its number.
  std::uint8_t bit_size = 0;      ///< From 1 to 32.
  std::int64_t logical_low = 0;
  std::int64_t logical_high = 0;
  bool is_relative = false;
  bool has_null = false;  ///< Values outside the logical range mean "none".
};

/// Fields that are not in ReportDescriptor::inputs: they are on other pages, in arrays, longer than
/// 32 bits, or exceed kFieldCountMax.
/// @ownership plain value
struct UnreadFields {
  std::uint32_t application = 0;
  std::uint32_t page = 0;  ///< The usage page; vendor-defined from 0xff00'0000.
  std::uint32_t count = 0;
};

/// @ownership a value
struct ReportDescriptor {
  /// The variable fields of up to 32 bits on the pages above, in descriptor order; at most
  /// kFieldCountMax.
  std::vector<Field> inputs{};
  /// One entry per application and page; at most kUnreadCountMax.
  std::vector<UnreadFields> unread{};
  bool has_report_ids = false;
  /// Size in bytes of the input report with each number, including the number; 0 if there is none.
  std::array<std::uint16_t, 256> input_sizes{};
};

inline constexpr std::size_t kDescriptorSizeMax = 4096;  ///< The limit in Linux.
inline constexpr std::size_t kFieldCountMax = 512;
inline constexpr std::size_t kUnreadCountMax = 64;

/// Parses a report descriptor. Untrusted data: every byte sequence gives a descriptor or an error.
/// Accepts what Linux accepts; unread fields only occupy space.
/// @errors   the fault, as a clause
/// @source   Linux, drivers/hid/hid-core.c
[[nodiscard]] expected<ReportDescriptor, std::string> parse_report_descriptor(ConstBytes bytes);

/// The value of `field` in `report`, sign-extended if its range includes negative values; nullopt
/// if this is another report or it is too short.
/// @realtime alloc-free
[[nodiscard]] std::optional<std::int64_t> value_of(const Field& field, ConstBytes report) noexcept;

}  // namespace rtpm::device_hid
