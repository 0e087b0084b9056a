#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::device_io {

/// The words that a driver takes.
struct KnownWords {
  std::vector<std::string_view> names{};
  /// Their values go on to the end of the text, spaces included, such as a file's name.
  std::vector<std::string_view> names_to_the_end{};
};

/// Values by names.
using Words = std::map<std::string, std::string, std::less<>>;

/// Reads a driver's arguments as an operator gives them: "port=/dev/ttyACM0 speed=115200", words
/// apart by spaces.
/// @param driver  for the errors: "serial"
/// @errors   a word without '=' or value, an unknown or repeated one: in words with those it takes
[[nodiscard]] expected<Words, SetupError> read_words(std::string_view driver, std::string_view text,
                                                     const KnownWords& known);

}  // namespace rtpm::device_io
