#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace rtpm::camerad {

/// A picture's brightness, row by row.
struct Luma {
  std::span<std::uint8_t> pixels{};
  std::size_t width = 0;
  std::size_t height = 0;
};

/// Paints a number as 8 rows of 8 black and white cells, and a row of their parity, over the left
/// half of the picture. Survives the compression of pictures of at least 160 × 90 pixels.
void paint_number(const Luma& picture, std::uint64_t number) noexcept;
/// The number that paint_number() painted; nullopt if the parity is wrong.
[[nodiscard]] std::optional<std::uint64_t> read_number(const Luma& picture) noexcept;
/// Paints the right half of the picture white or black.
void paint_lamp(const Luma& picture, bool is_lit) noexcept;
/// Whether the right half of the picture is rather white.
[[nodiscard]] bool read_lamp(const Luma& picture) noexcept;

}  // namespace rtpm::camerad
