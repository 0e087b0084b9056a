#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <CLI/CLI.hpp>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "rtpm/base/priority.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/program/duration.hpp"
#include "rtpm/program/text.hpp"

// CLI11's conversions are not used: a force of "nan" would pass its Range, and "010" be 8.
namespace rtpm::options {

using Texts = std::vector<std::string>;

/// An option, without the type of its variable.
struct Setting {
  CLI::Option* option = nullptr;  ///< Its flag and its environment variable.
  Texts path{};                   ///< The names of its tables in the file, then its key.
  std::string help{};
  std::string kind{};      ///< The value in --help: "NUMBER"; a switch has none.
  std::string expected{};  ///< Continues "… is not", as in "a number from 1 to 5".
  bool is_list = false;    ///< Its flag may be repeated.
  bool is_bare = false;    ///< Without quotes in a file.
  bool is_secret = false;  ///< Refused on the command line, and never printed.
  /// Sets the variable from texts, one if it is no list; false, and no change, if they are invalid.
  std::function<bool(const Texts&)> read{};
  /// The variable as texts that `read` takes.
  std::function<Texts()> write{};
  std::string source = "default";  ///< The origin of the value in force.
};

/// Whether a file has values of this type without quotes. TOML's whole numbers end at 2^63 - 1.
template <class T>
constexpr bool kIsBare =
    (std::is_arithmetic_v<T> && !std::is_same_v<T, std::uint64_t>) || std::is_same_v<T, Priority>;

/// A setting of one text, which `parse` turns into an optional value and `format` back.
template <class T, class Parse, class Format>
Setting single(T& value, std::string kind, std::string expected, Parse parse, Format format) {
  Setting setting{.kind = std::move(kind), .expected = std::move(expected), .is_bare = kIsBare<T>};
  setting.read = [&value, parse](const Texts& texts) {
    std::optional<T> read = texts.size() == 1 ? parse(texts.front()) : std::nullopt;
    if (read) value = std::move(*read);
    return read.has_value();
  };
  setting.write = [&value, format] { return Texts{std::string(format(value))}; };
  return setting;
}

/// Likewise of any number of texts. One empty text is an empty list.
template <class T, class Parse, class Format>
Setting list(std::vector<T>& value, std::string kind, std::string expected, Parse parse,
             Format format) {
  Setting setting{.kind = std::move(kind),
                  .expected = std::move(expected),
                  .is_list = true,
                  .is_bare = kIsBare<T>};
  setting.read = [&value, parse](const Texts& texts) {
    std::vector<T> items;
    for (const std::string& text : texts == Texts{""} ? Texts{} : texts) {
      std::optional<T> item = parse(text);
      if (!item) return false;
      items.push_back(std::move(*item));
    }
    value = std::move(items);
    return true;
  };
  setting.write = [&value, format] {
    Texts texts;
    std::ranges::transform(value, std::back_inserter(texts), format);
    return texts;
  };
  return setting;
}

inline std::string_view to_string(const std::string& text) {
  return text;
}

/// One of `choices`, which are texts or values of an enum.
template <class T>
Setting choice(T& value, const std::vector<T>& choices) {
  Texts words;
  for (const T& each : choices)
    words.emplace_back(to_string(each));
  return single(
      value, program::joined(words, "|"), "one of " + program::joined(words),
      [choices](std::string_view word) {
        const auto found =
            std::ranges::find(choices, word, [](const T& each) { return to_string(each); });
        return found == choices.end() ? std::nullopt : std::optional(*found);
      },
      [](const T& each) { return to_string(each); });
}

/// All of `text` as a number; nothing if it is not one or out of range.
template <class T>
std::optional<T> number_in(std::string_view text, Range<T> range) {
  T number{};
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, number);
  // NaN fails both comparisons, so it is never in a range.
  const bool is_valid =
      read.ec == std::errc{} && read.ptr == end && number >= range.low && number <= range.high;
  return is_valid ? std::optional(number) : std::nullopt;
}

/// The shortest text that reads back as the same number.
template <class T>
std::string number_text(T number) {
  std::array<char, 32> buffer{};
  const auto written = std::to_chars(buffer.data(), buffer.data() + buffer.size(), number);
  return {buffer.data(), written.ptr};
}

/// The setting of a number.
template <class T>
Setting setting_of(T& value, Range<T> range) {
  std::string expected = std::is_integral_v<T> ? "a whole number" : "a number";
  if (range.high < std::numeric_limits<T>::max() || std::is_integral_v<T>)
    expected += " from " + number_text(range.low) + " to " + number_text(range.high);
  return single(
      value, "NUMBER", expected,
      [range](const std::string& text) { return number_in(text, range); }, number_text<T>);
}

inline Setting setting_of(std::string& value, Range<std::string>) {
  return single(
      value, "TEXT", "a text", [](const std::string& text) { return std::optional(text); },
      [](const std::string& text) { return text; });
}

inline Setting setting_of(bool& value, Range<bool>) {
  return single(
      value, "", "true or false",
      [](const std::string& text) {
        const bool is_valid = text == "true" || text == "false";
        return is_valid ? std::optional(text == "true") : std::nullopt;
      },
      [](bool is_on) { return is_on ? "true" : "false"; });
}

inline Setting setting_of(Duration& value, Range<Duration> range) {
  std::string expected = "a time with a unit, such as 800us or 2s";
  if (range.low > Duration{0}) expected += ", of at least " + program::duration_text(range.low);
  if (range.high < Duration::max())
    expected += ", of at most " + program::duration_text(range.high);
  return single(
      value, "TIME", expected,
      [range](const std::string& text) {
        const std::optional<Duration> time = program::parse_duration(text);
        return time && *time >= range.low && *time <= range.high ? time : std::nullopt;
      },
      program::duration_text);
}

inline Setting setting_of(std::optional<Duration>& value, Range<std::optional<Duration>>) {
  return single(
      value, "off|TIME", "off, or a time with a unit, such as 20us",
      [](const std::string& text) -> std::optional<std::optional<Duration>> {
        const std::optional<Duration> time = program::parse_duration(text);
        if (text != "off" && !time) return std::nullopt;
        return std::optional<std::optional<Duration>>(std::in_place, time);
      },
      [](const auto& time) { return time ? program::duration_text(*time) : "off"; });
}

inline Setting setting_of(Priority& value, Range<Priority>) {
  return single(
      value, "PRIORITY", "a priority, a whole number from 0 (least urgent) to 32767",
      [](const std::string& text) -> std::optional<Priority> {
        return number_in(text, Range<int>{Priority::kLowest, Priority::kHighest});
      },
      [](Priority priority) { return number_text(priority.value()); });
}

inline Setting setting_of(rt::Schedule& value, Range<rt::Schedule>) {
  return choice(value, {rt::Schedule::kFifo, rt::Schedule::kTimeShared});
}

inline Setting setting_of(Texts& value, Range<Texts>) {
  return list(
      value, "TEXT,TEXT", "a list with commas, without empty items",
      [](const std::string& text) { return text.empty() ? std::nullopt : std::optional(text); },
      [](const std::string& text) { return text; });
}

inline Setting setting_of(std::vector<int>& value, Range<std::vector<int>>) {
  return list(
      value, "NUMBER,NUMBER", "a list of numbers from 0 to 1023, with commas",
      [](const std::string& text) {
        return number_in(text, Range<int>{0, 1023});
      },
      number_text<int>);
}

}  // namespace rtpm::options
