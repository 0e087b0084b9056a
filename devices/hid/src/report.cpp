#include "report.hpp"

#include <algorithm>
#include <array>

namespace rtpm::device_hid {

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
