#pragma once

#include <charconv>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::driver {

/// The words that a driver accepts.
struct KnownWords {
  std::vector<std::string_view> names{};
  /// Words whose values extend to the end of the text, including spaces, such as a file name.
  std::vector<std::string_view> names_to_the_end{};
};

/// Values by names.
using Words = std::map<std::string, std::string, std::less<>>;

/// Parses the arguments that an operator gives a driver: "port=/dev/ttyACM0 speed=115200", words
/// separated by spaces.
/// @param driver  for the errors: "serial"
/// @errors   a word without '=' or value, an unknown or repeated word; names the known words
[[nodiscard]] expected<Words, SetupError> read_words(std::string_view driver, std::string_view text,
                                                     const KnownWords& known);

/// The value of the word `name`; empty if it was not given.
[[nodiscard]] std::string value_of(const Words& words, std::string_view name);

/// Parses all of `text` as a number; nullopt if it is not one, or T can't hold it.
template <class T>
[[nodiscard]] std::optional<T> to_number(std::string_view text) {
  T number{};
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, number);
  return error == std::errc{} && stop == end ? std::optional(number) : std::nullopt;
}

}  // namespace rtpm::driver
