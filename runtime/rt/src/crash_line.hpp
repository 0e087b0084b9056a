#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace rtpm::rt {

/// A line of text, built without the heap, as a crash requires. Longer text is cut off.
/// @realtime callable in a signal handler
struct CrashLine {
  void add(std::string_view text) noexcept {
    const std::size_t taken = std::min(text.size(), bytes.size() - 1 - size);
    std::memcpy(bytes.data() + size, text.data(), taken);
    size += taken;
  }
  void add_number(std::uint32_t number, std::uint32_t base = 10) noexcept {
    std::array<char, 12> digits{};
    std::size_t at = digits.size();
    do {
      digits[--at] = "0123456789abcdef"[number % base];
      number /= base;
    } while (number > 0);
    add({digits.data() + at, digits.size() - at});
  }
  /// The notes of the calling thread.
  void add_notes() noexcept;

  std::array<char, 1024> bytes{};
  std::size_t size = 0;
};

/// Writes the line about a crash of the calling thread to standard error.
/// @param cause            what ends the process: "signal 11 (segmentation fault)"
/// @param program_counter  where the thread was; 0 if unknown
/// @realtime callable in a signal handler
void write_crash(std::string_view cause, std::uintptr_t program_counter) noexcept;

}  // namespace rtpm::rt
