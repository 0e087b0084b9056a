#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/options/options.hpp"

namespace rtpm::options {

/// One variable of a program: how to parse, format and document it.
struct Setting {
  std::string key;
  std::string variable{};  ///< The environment variable: "RTPM_PORT".
  std::string help;
  std::string placeholder;  ///< Stands for the value in --help: "NUMBER".
  std::string expected;     ///< The permitted values: "a whole number from 0 to 65535".
  bool is_switch = false;   ///< Its flag means true without a value.
  bool is_list = false;     ///< Its flag may be repeated.
  bool is_secret = false;   ///< Refused on the command line, and never printed.
  /// Sets the variable from text; false, and no change, if the text is not valid.
  std::function<bool(std::string_view)> read{};
  /// The variable as text that `read` takes.
  std::function<std::string()> write{};
};

/// The setting of a variable; keeps a reference to it.
/// @realtime set-up only
[[nodiscard]] Setting setting_of(std::string& value);
[[nodiscard]] Setting setting_of(bool& value);
[[nodiscard]] Setting setting_of(int& value, Range<int> range);
[[nodiscard]] Setting setting_of(std::uint16_t& value, Range<std::uint16_t> range);
[[nodiscard]] Setting setting_of(std::uint32_t& value, Range<std::uint32_t> range);
[[nodiscard]] Setting setting_of(std::uint64_t& value, Range<std::uint64_t> range);
[[nodiscard]] Setting setting_of(double& value, Range<double> range);
[[nodiscard]] Setting setting_of(Duration& value, Range<Duration> range);
[[nodiscard]] Setting setting_of(Priority& value);
[[nodiscard]] Setting setting_of(std::vector<std::string>& value);
[[nodiscard]] Setting setting_of(std::vector<int>& value);
/// A time, or "off".
[[nodiscard]] Setting setting_of(std::optional<Duration>& value, Range<Duration> range);
/// Names as Options::add_group() takes them.
[[nodiscard]] Setting setting_of_names(std::vector<std::string>& value, std::size_t size_max);
/// One of `choices`, as `read` and `write` know them.
[[nodiscard]] Setting setting_of_choice(const std::vector<std::string>& choices,
                                        std::function<void(std::string_view)> read,
                                        std::function<std::string()> write);

/// The candidate nearest to `word`, or empty if none is close enough to be a typing error.
/// @realtime set-up only
[[nodiscard]] std::string nearest(std::string_view word,
                                  const std::vector<std::string>& candidates);

}  // namespace rtpm::options
