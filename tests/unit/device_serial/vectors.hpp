#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"

/// The test vectors of devices/serial/FRAMES.md, as they go over the line.
namespace rtpm::test::vectors {

inline std::vector<std::byte> bytes(std::string_view hex) {
  const auto digit = [](char c) { return c <= '9' ? c - '0' : c - 'a' + 10; };
  std::vector<std::byte> result;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 3)
    result.push_back(static_cast<std::byte>(digit(hex[i]) * 16 + digit(hex[i + 1])));
  return result;
}

inline constexpr std::string_view kHello = "04 01 01 01 02 04 09 78 56 34 12 4d 0d 21 c2 00";
inline constexpr std::string_view kDescription =
    "04 01 02 01 02 6c 24 78 56 34 12 f4 01 0b 52 54 50 4d 20 70 61 64 64 6c 65 08 50 41 44 44 4c "
    "45 2d 31 01 06 70 61 64 64 6c 65 01 01 03 40 bf 01 03 40 3f 01 01 0a 3e 02 04 67 72 69 70 01 "
    "31 01 01 01 01 01 0b 80 3f 05 6c 69 67 68 74 01 31 01 01 01 01 01 13 80 3f 01 06 62 75 74 74 "
    "6f 6e 01 04 6c 61 6d 70 01 31 01 01 01 01 01 03 80 3f 01 01 01 05 92 2e 29 8c 00";
inline constexpr std::string_view kCommand =
    "04 01 03 02 02 0b 03 01 1e 01 01 03 80 3d 01 07 80 3f 3c 33 c3 1a 00";
inline constexpr std::string_view kOff =
    "04 01 03 03 02 0b 01 02 01 01 01 01 01 01 01 01 01 05 e8 30 f7 7e 00";
inline constexpr std::string_view kState =
    "04 01 04 02 02 22 02 02 01 01 04 40 42 0f 02 01 01 01 03 80 3e 01 03 c0 bf 01 03 80 3d 01 03 "
    "80 3e 01 01 02 3f 01 07 80 3f 51 27 6e fc 00";

}  // namespace rtpm::test::vectors
