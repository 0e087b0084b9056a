#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "rtpm/base/time.hpp"

/// The operating system's side of standard input and the terminal.
namespace rtpm::program::os {

/// The columns of the terminal at standard output; 0 if that is unknown.
[[nodiscard]] std::size_t terminal_width() noexcept;

enum class InputEnd : std::uint8_t { kNone, kEnd };
/// The state that the system needs between two reads; null before the first.
class Input;
/// Appends the bytes of standard input that are there within `patience`, not negative.
/// @return nullopt if it was interrupted or has appended some; else why there are none
[[nodiscard]] std::optional<InputEnd> read_input(std::shared_ptr<Input>& input, Duration patience,
                                                 std::string& to);

}  // namespace rtpm::program::os
