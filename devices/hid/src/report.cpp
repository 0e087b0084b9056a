#include "report.hpp"

#include <algorithm>
#include <array>

namespace rtpm::device_hid {
namespace {

constexpr std::array<std::uint32_t, 256> crc_table() noexcept {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < table.size(); ++i) {
    std::uint32_t rest = i;
    for (int bit = 0; bit < 8; ++bit)
      rest = (rest & 1) != 0 ? rest >> 1 ^ 0xedb88320 : rest >> 1;
    table[i] = rest;
  }
  return table;
}
constexpr auto kCrcTable = crc_table();

constexpr std::uint32_t crc_step(std::uint32_t crc, std::uint8_t byte) noexcept {
  return crc >> 8 ^ kCrcTable[(crc ^ byte) & 0xff];
}

}  // namespace

std::uint32_t crc32(std::uint8_t seed, ConstBytes bytes) noexcept {
  std::uint32_t crc = crc_step(0xffffffff, seed);
  for (const std::byte byte : bytes)
    crc = crc_step(crc, std::to_integer<std::uint8_t>(byte));
  return ~crc;
}

bool has_size(ConstBytes report, std::size_t size) noexcept {
  return report.size() >= size && std::ranges::all_of(report.subspan(size), [](std::byte byte) {
           return byte == std::byte{0};
         });
}

bool goes_one_way(std::uint32_t usage) noexcept {
  constexpr std::array kOneWay{kDesktopPage + 0x36, kSimulationPage + 0xbb, kSimulationPage + 0xc4,
                               kSimulationPage + 0xc5};
  return std::ranges::count(kOneWay, usage) > 0;
}

double share_of(const Field& field, std::int64_t value) noexcept {
  const std::int64_t clamped = std::clamp(value, field.logical_low, field.logical_high);
  const double share = static_cast<double>(clamped - field.logical_low) /
                       static_cast<double>(field.logical_high - field.logical_low);
  return goes_one_way(field.usage) ? share : 2 * share - 1;
}

}  // namespace rtpm::device_hid
