#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/options/options.hpp"

namespace rtpm::options {

using Texts = std::vector<std::string>;

/// An option, without the type of its variable.
struct Setting {
  Texts path{};            ///< Its key in the file, behind the names of its tables.
  std::string flag{};      ///< "--lane-haptic-low"
  std::string variable{};  ///< "RTPM_LANE_HAPTIC_LOW"
  std::string help{};
  std::string placeholder{};  ///< The value's kind in --help: "NUMBER".
  std::string expected{};     ///< Continues "… is not", as in "a number from 1 to 5".
  bool is_switch = false;     ///< Its flag means true without a value.
  bool is_list = false;       ///< Its flag may be repeated.
  bool is_text = true;        ///< In quotes in a file.
  bool is_rare = false;       ///< Shown by --help-all only.
  bool is_secret = false;     ///< Refused on the command line, and never printed.
  /// Sets the variable from texts, one if it is no list; false, and no change, if they are invalid.
  std::function<bool(const Texts&)> read{};
  /// The variable as texts that `read` takes.
  std::function<Texts()> write{};
  std::string source = "default";  ///< The origin of the value in force.
};

/// The setting of a variable; keeps a reference to it.
/// @realtime set-up only
[[nodiscard]] Setting setting_of(std::string& value);
[[nodiscard]] Setting setting_of(bool& value);
template <class T>
[[nodiscard]] Setting setting_of(T& value, Range<T> range);
[[nodiscard]] Setting setting_of(std::vector<std::string>& value);
[[nodiscard]] Setting setting_of(std::vector<int>& value);
/// A time, or "off".
[[nodiscard]] Setting setting_of(std::optional<Duration>& value, Range<Duration> range);
/// Names as Options::add_group() takes them.
[[nodiscard]] Setting setting_of_names(std::vector<std::string>& value, std::size_t size_max);
/// One of `choices`, as `read` and `write` know them.
[[nodiscard]] Setting setting_of_choice(const Texts& choices,
                                        std::function<void(const std::string&)> read,
                                        std::function<std::string()> write);

/// The text of a flag or variable as `read` takes it: a list is split at its commas.
[[nodiscard]] Texts texts_of(const Setting& setting, std::string_view text);

}  // namespace rtpm::options
