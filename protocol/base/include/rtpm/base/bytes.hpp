#pragma once

#include <algorithm>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

#include "rtpm/base/assert.hpp"

namespace rtpm::inline base {

using ConstBytes = std::span<const std::byte>;
using MutableBytes = std::span<std::byte>;

/// Reads the little-endian number at `from`, which may be unaligned.
template <std::unsigned_integral T>
[[nodiscard]] inline T load_le(const std::byte* from) noexcept {
  T value;
  std::memcpy(&value, from, sizeof value);
  if constexpr (std::endian::native == std::endian::big && sizeof(T) > 1) {
    T swapped = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      swapped = static_cast<T>((swapped << 8) | ((value >> (8 * i)) & 0xff));
    }
    return swapped;
  }
  return value;
}

/// Writes `value` little-endian at `to`, which may be unaligned.
template <std::unsigned_integral T>
inline void store_le(std::byte* to, T value) noexcept {
  if constexpr (std::endian::native == std::endian::big && sizeof(T) > 1) {
    for (std::size_t i = 0; i < sizeof(T); ++i)
      to[i] = static_cast<std::byte>(value >> (8 * i));
  } else {
    std::memcpy(to, &value, sizeof value);
  }
}

/// Reads consecutive little-endian fields from untrusted bytes. Reading past the end returns zeros
/// and leaves ok() false permanently, so a parser checks only once, at its end.
/// @ownership views its bytes
/// @realtime alloc-free
class ByteReader {
 public:
  explicit ByteReader(ConstBytes bytes) noexcept : bytes_(bytes) {}

  template <std::unsigned_integral T>
  [[nodiscard]] T take() noexcept {
    const ConstBytes field = take_bytes(sizeof(T));
    return field.empty() ? T{0} : load_le<T>(field.data());
  }
  /// Returns a view of the next `count` bytes; empty if there are fewer.
  [[nodiscard]] ConstBytes take_bytes(std::size_t count) noexcept {
    if (count > bytes_.size() - offset_) {
      ok_ = false;
      return {};
    }
    const ConstBytes field = bytes_.subspan(offset_, count);
    offset_ += count;
    return field;
  }
  /// Skips `count` reserved bytes.
  /// @return whether they exist and are all zero
  [[nodiscard]] bool take_zeros(std::size_t count) noexcept {
    const ConstBytes field = take_bytes(count);
    return ok_ && std::ranges::all_of(field, [](std::byte b) { return b == std::byte{0}; });
  }
  /// Returns a view of a text stored as a u16 length followed by its bytes.
  [[nodiscard]] std::string_view take_text() noexcept {
    const ConstBytes text = take_bytes(take<std::uint16_t>());
    return {reinterpret_cast<const char*>(text.data()), text.size()};
  }
  [[nodiscard]] bool ok() const noexcept { return ok_; }
  [[nodiscard]] std::size_t left() const noexcept { return bytes_.size() - offset_; }

 private:
  ConstBytes bytes_;
  std::size_t offset_ = 0;
  bool ok_ = true;
};

/// Writes consecutive little-endian fields. Writing past the end writes nothing and leaves ok()
/// false permanently.
/// @ownership views its bytes
/// @realtime alloc-free
class ByteWriter {
 public:
  explicit ByteWriter(MutableBytes bytes) noexcept : bytes_(bytes) {}

  template <std::unsigned_integral T>
  void put(T value) noexcept {
    if (std::byte* to = claim(sizeof(T))) store_le(to, value);
  }
  void put_bytes(ConstBytes bytes) noexcept {
    if (std::byte* to = claim(bytes.size()); to != nullptr && !bytes.empty()) {
      std::memcpy(to, bytes.data(), bytes.size());
    }
  }
  /// Writes a u16 length and the bytes; fails for more than 65535 bytes.
  void put_text(std::string_view text) noexcept {
    if (text.size() > 0xffff) {
      ok_ = false;
      return;
    }
    put(static_cast<std::uint16_t>(text.size()));
    put_bytes(std::as_bytes(std::span(text)));
  }
  void put_zeros(std::size_t count) noexcept {
    if (std::byte* to = claim(count); to != nullptr && count > 0) std::memset(to, 0, count);
  }
  [[nodiscard]] bool ok() const noexcept { return ok_; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] std::size_t left() const noexcept { return bytes_.size() - size_; }

 private:
  [[nodiscard]] std::byte* claim(std::size_t count) noexcept {
    if (!ok_ || count > bytes_.size() - size_) {
      ok_ = false;
      return nullptr;
    }
    std::byte* at = bytes_.data() + size_;
    size_ += count;
    return at;
  }

  MutableBytes bytes_;
  std::size_t size_ = 0;
  bool ok_ = true;
};

}  // namespace rtpm::inline base
