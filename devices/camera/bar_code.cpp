#include "bar_code.hpp"

#include <algorithm>

namespace rtpm::camerad {
namespace {

constexpr std::size_t kColumnCount = 8;
constexpr std::size_t kRowCount = 9;  // The last one has the parities of the columns.
constexpr std::uint8_t kBlack = 16;
constexpr std::uint8_t kWhite = 235;
constexpr std::uint8_t kGrey = 128;

/// The cells, one byte a row.
std::uint8_t row_of(std::uint64_t number, std::size_t row) noexcept {
  if (row + 1 < kRowCount) return static_cast<std::uint8_t>(number >> (8 * row));
  std::uint8_t parity = 0x5a;  // An even picture is no number.
  for (std::size_t i = 0; i + 1 < kRowCount; ++i)
    parity = static_cast<std::uint8_t>(parity ^ (number >> (8 * i)));
  return parity;
}

void fill(const Luma& picture, std::size_t left, std::size_t top, std::size_t width,
          std::size_t height, std::uint8_t value) noexcept {
  for (std::size_t y = top; y < top + height; ++y) {
    std::fill_n(picture.pixels.begin() + static_cast<std::ptrdiff_t>(y * picture.width + left),
                width, value);
  }
}

}  // namespace

void paint_number(const Luma& picture, std::uint64_t number) noexcept {
  const std::size_t width = picture.width / 2 / kColumnCount;
  const std::size_t height = picture.height / kRowCount;
  for (std::size_t row = 0; row < kRowCount; ++row) {
    for (std::size_t column = 0; column < kColumnCount; ++column) {
      const bool is_set = ((row_of(number, row) >> column) & 1) != 0;
      fill(picture, column * width, row * height, width, height, is_set ? kWhite : kBlack);
    }
  }
}

std::optional<std::uint64_t> read_number(const Luma& picture) noexcept {
  const std::size_t width = picture.width / 2 / kColumnCount;
  const std::size_t height = picture.height / kRowCount;
  std::uint64_t number = 0;
  std::uint8_t parity = 0;
  for (std::size_t row = 0; row < kRowCount; ++row) {
    std::uint8_t cells = 0;
    for (std::size_t column = 0; column < kColumnCount; ++column) {
      const std::size_t x = column * width + width / 2;
      const std::size_t y = row * height + height / 2;
      if (picture.pixels[y * picture.width + x] >= kGrey)
        cells = static_cast<std::uint8_t>(cells | (1U << column));
    }
    if (row + 1 < kRowCount) {
      number |= std::uint64_t{cells} << (8 * row);
    } else {
      parity = cells;
    }
  }
  if (parity != row_of(number, kRowCount - 1)) return std::nullopt;
  return number;
}

void paint_lamp(const Luma& picture, bool is_lit) noexcept {
  const std::size_t left = picture.width / 2;
  fill(picture, left, 0, picture.width - left, picture.height, is_lit ? kWhite : kBlack);
}

bool read_lamp(const Luma& picture) noexcept {
  const std::size_t x = picture.width * 3 / 4;
  const std::size_t y = picture.height / 2;
  return picture.pixels[y * picture.width + x] >= kGrey;
}

}  // namespace rtpm::camerad
