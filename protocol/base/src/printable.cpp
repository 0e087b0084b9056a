#include "rtpm/base/printable.hpp"

#include <algorithm>
#include <array>
#include <cstdint>

namespace rtpm::inline base {
namespace {

/// A character and its size in bytes; the size is 0 if the bytes are not UTF-8.
struct Character {
  std::uint32_t code = 0;
  std::size_t size = 0;
};

constexpr std::uint8_t byte_of(char character) noexcept {
  return static_cast<std::uint8_t>(character);
}

Character first_of(std::string_view text) noexcept {
  const std::uint8_t first = byte_of(text[0]);
  if (first < 0x80) return {first, 1};
  const std::size_t size = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
  if (first < 0xc2 || first > 0xf4 || text.size() < size) return {};
  std::uint32_t code = first & (0x7fU >> size);
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte_of(text[i]) & 0xc0) != 0x80) return {};
    code = code << 6 | (byte_of(text[i]) & 0x3f);
  }
  // Overlong, a UTF-16 surrogate, or beyond Unicode.
  constexpr std::array<std::uint32_t, 5> kLeast{0, 0, 0x80, 0x800, 0x1'0000};
  if (code < kLeast[size] || (code >= 0xd800 && code <= 0xdfff) || code > 0x10'ffff) return {};
  return {code, size};
}

struct Range {
  std::uint32_t first = 0;
  std::uint32_t last = 0;
};
// Control characters, zero-width characters, line separators, direction marks, and tags.
constexpr std::array kHidden{Range{0x00, 0x1f},     Range{0x7f, 0x9f},      Range{0xad, 0xad},
                             Range{0x61c, 0x61c},   Range{0x115f, 0x1160},  Range{0x180e, 0x180e},
                             Range{0x200b, 0x200f}, Range{0x2028, 0x202e},  Range{0x2060, 0x206f},
                             Range{0x3164, 0x3164}, Range{0xfe00, 0xfe0f},  Range{0xfeff, 0xfeff},
                             Range{0xfff0, 0xfffb}, Range{0xe0000, 0xe0fff}};

bool is_hidden(std::uint32_t code) noexcept {
  return std::ranges::any_of(
      kHidden, [&](Range range) { return range.first <= code && code <= range.last; });
}

void add_hex(std::string& to, std::uint32_t value, int digit_count_min) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  int digit_count = 1;
  while (digit_count < 8 && (value >> (4 * digit_count)) != 0)
    ++digit_count;
  for (int i = std::max(digit_count, digit_count_min) - 1; i >= 0; --i)
    to += kDigits[(value >> (4 * i)) & 0xf];
}

void add_escaped(std::string& to, Character character) {
  switch (character.code) {
    case '\n':
      to += "\\n";
      return;
    case '\r':
      to += "\\r";
      return;
    case '\t':
      to += "\\t";
      return;
    default:
      break;
  }
  if (character.size == 1) {
    to += "\\x";
    add_hex(to, character.code, 2);
    return;
  }
  to += "\\u{";
  add_hex(to, character.code, 1);
  to += '}';
}

std::string escaped(std::string_view text, std::size_t size_max, bool keeps_lines) {
  std::string shown;
  std::size_t at = 0;
  while (at < text.size()) {
    // Most text is ASCII: its runs are copied at once.
    std::size_t end = at;
    while (end < std::min(text.size(), size_max) && text[end] >= ' ' && text[end] <= '~')
      ++end;
    shown.append(text, at, end - at);
    at = end;
    if (at == text.size()) break;
    Character character = first_of(text.substr(at));
    const bool is_broken = character.size == 0;
    if (is_broken) character = {byte_of(text[at]), 1};
    if (at + character.size > size_max) break;
    const bool is_kept = keeps_lines && (character.code == '\n' || character.code == '\t');
    if (!is_kept && (is_broken || is_hidden(character.code))) {
      add_escaped(shown, character);
    } else {
      shown += text.substr(at, character.size);
    }
    at += character.size;
  }
  return at < text.size() ? shown + "…" : shown;
}

}  // namespace

std::string printable(std::string_view text, std::size_t size_max) {
  return escaped(text, size_max, /*keeps_lines=*/false);
}

std::string printable_lines(std::string_view text, std::size_t size_max) {
  return escaped(text, size_max, /*keeps_lines=*/true);
}

}  // namespace rtpm::inline base
