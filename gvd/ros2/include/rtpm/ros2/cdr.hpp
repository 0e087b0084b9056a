#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "rtpm/base/bytes.hpp"

/// CDR as ROS 2 has it: four bytes of encapsulation, then values aligned to their own size.
/// @source   OMG DDS-RTPS 2.5, section 10 (plain CDR, little-endian)
namespace rtpm::ros2 {

template <class T>
concept Number = (std::is_arithmetic_v<T> || std::is_same_v<T, std::byte>)&&(sizeof(T) <= 8);

/// The unsigned integer of `size` bytes.
template <std::size_t size>
using UnsignedOf = std::conditional_t<
    size == 1, std::uint8_t,
    std::conditional_t<size == 2, std::uint16_t,
                       std::conditional_t<size == 4, std::uint32_t, std::uint64_t>>>;

/// Appends one message to a buffer.
/// @ownership views its buffer
/// @realtime allocates in the buffer
class CdrWriter {
 public:
  /// Replaces the content of `buffer` by the encapsulation.
  explicit CdrWriter(std::vector<std::byte>& buffer);

  template <Number T>
  void put(T value) {
    store_le(grow(sizeof(T), sizeof(T)), std::bit_cast<UnsignedOf<sizeof(T)>>(value));
  }
  /// A text with its length; the bytes from its first NUL on are left out.
  void put_text(std::string_view text);
  void put_bytes(ConstBytes bytes);

 private:
  [[nodiscard]] std::byte* grow(std::size_t alignment, std::size_t size);

  std::vector<std::byte>& buffer_;
};

/// Reads one message from untrusted bytes. After the first fault all reads return zeros.
/// @ownership views its bytes
class CdrReader {
 public:
  explicit CdrReader(ConstBytes message) noexcept;

  template <Number T>
  [[nodiscard]] T take() noexcept {
    const ConstBytes field = claim(sizeof(T), sizeof(T));
    if (field.empty()) return T{};
    const auto bits = load_le<UnsignedOf<sizeof(T)>>(field.data());
    if constexpr (std::is_same_v<T, bool>) {
      if (bits > 1) fail("a truth value is neither 0 nor 1");
      return bits == 1;
    } else {
      return std::bit_cast<T>(bits);
    }
  }
  [[nodiscard]] std::string_view take_text() noexcept;
  [[nodiscard]] ConstBytes take_bytes(std::size_t count) noexcept { return claim(1, count); }
  /// The number of a sequence's elements; fails if the rest can't hold them.
  /// @param size_min  of an element
  [[nodiscard]] std::size_t take_count(std::size_t size_min) noexcept;

  void fail(std::string_view reason) noexcept {
    if (reason_.empty()) reason_ = reason;
  }
  [[nodiscard]] bool ok() const noexcept { return reason_.empty(); }
  /// Fails if more than padding is left.
  void end() noexcept;
  /// The first fault; empty if there is none.
  [[nodiscard]] std::string_view reason() const noexcept { return reason_; }

 private:
  [[nodiscard]] ConstBytes claim(std::size_t alignment, std::size_t size) noexcept;

  ConstBytes body_{};
  std::size_t offset_ = 0;
  std::string_view reason_{};
};

}  // namespace rtpm::ros2
