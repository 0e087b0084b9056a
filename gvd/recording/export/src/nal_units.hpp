#pragma once

#include <cstddef>
#include <vector>

#include "rtpm/base/bytes.hpp"

namespace rtpm::exports {

/// The kinds of NAL units that matter here.
/// @source   ITU-T H.264, table 7-1
enum class NalKind : unsigned char {
  kKeySlice = 5,
  kSequenceParameters = 7,
  kPictureParameters = 8,
  kDelimiter = 9,
};

/// The NAL units of a picture in Annex B, without start codes; none is empty.
[[nodiscard]] inline std::vector<ConstBytes> nal_units(ConstBytes annex_b) {
  std::vector<ConstBytes> units;
  const auto is_code = [&](std::size_t at) {
    return at + 3 <= annex_b.size() && annex_b[at] == std::byte{0} &&
           annex_b[at + 1] == std::byte{0} && annex_b[at + 2] == std::byte{1};
  };
  std::size_t at = 0;
  while (at < annex_b.size() && !is_code(at))
    ++at;
  while (at < annex_b.size()) {
    const std::size_t begin = at + 3;
    at = begin;
    while (at < annex_b.size() && !is_code(at))
      ++at;
    std::size_t end = at;
    // A start code of four bytes begins with one more zero; no unit ends with one.
    while (end > begin && annex_b[end - 1] == std::byte{0})
      --end;
    if (end > begin) units.push_back(annex_b.subspan(begin, end - begin));
  }
  return units;
}

/// The kind of a unit that nal_units() gave.
[[nodiscard]] inline NalKind kind_of(ConstBytes unit) noexcept {
  return static_cast<NalKind>(std::to_integer<unsigned>(unit[0]) & 31U);
}

}  // namespace rtpm::exports
