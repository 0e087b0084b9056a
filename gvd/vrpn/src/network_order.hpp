#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "rtpm/base/bytes.hpp"

// Numbers in network order.
namespace rtpm::vrpn {

template <class Bits>
void put_bits(std::vector<std::byte>& to, Bits value) {
  for (std::size_t i = sizeof value; i-- > 0;)
    to.push_back(static_cast<std::byte>(value >> (8 * i) & 0xff));
}

template <class Bits>
[[nodiscard]] Bits bits_at(ConstBytes bytes, std::size_t at) noexcept {
  Bits value = 0;
  for (std::size_t i = 0; i < sizeof value; ++i)
    value = static_cast<Bits>(value << 8 | std::to_integer<Bits>(bytes[at + i]));
  return value;
}

inline void put_u32(std::vector<std::byte>& to, std::uint32_t value) {
  put_bits(to, value);
}
inline void put_double(std::vector<std::byte>& to, double value) {
  put_bits(to, std::bit_cast<std::uint64_t>(value));
}
[[nodiscard]] inline std::uint32_t u32_at(ConstBytes bytes, std::size_t at) noexcept {
  return bits_at<std::uint32_t>(bytes, at);
}
[[nodiscard]] inline double double_at(ConstBytes bytes, std::size_t at) noexcept {
  return std::bit_cast<double>(bits_at<std::uint64_t>(bytes, at));
}

}  // namespace rtpm::vrpn
