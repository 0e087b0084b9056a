#include "setting.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <limits>
#include <system_error>
#include <utility>

#include "rtpm/base/assert.hpp"
#include "rtpm/program/duration.hpp"
#include "rtpm/program/text.hpp"

namespace rtpm::options {
namespace {

constexpr Range<int> kCpus{0, 1023};

/// A setting with one text, which `parse` turns into an optional value.
template <class T, class Parse, class Format>
Setting setting_with(T& value, std::string placeholder, std::string expected, Parse parse,
                     Format format) {
  Setting setting;
  setting.placeholder = std::move(placeholder);
  setting.expected = std::move(expected);
  setting.read = [&value, parse](const Texts& texts) {
    auto read = texts.size() == 1 ? parse(texts.front()) : std::nullopt;
    if (read) value = std::move(*read);
    return read.has_value();
  };
  setting.write = [&value, format] { return Texts{format(value)}; };
  return setting;
}

/// Parses all of `text` as a number; nothing if it is not one or out of range.
template <class T>
std::optional<T> read_number(std::string_view text, Range<T> range) {
  T number{};
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, number);
  // NaN fails both comparisons, so it is never in a range.
  if (read.ec != std::errc{} || read.ptr != end || !(number >= range.low && number <= range.high))
    return std::nullopt;
  return number;
}

/// The shortest text that reads back as the same number.
template <class T>
std::string number_text(T number) {
  std::array<char, 32> buffer{};
  const auto written = std::to_chars(buffer.data(), buffer.data() + buffer.size(), number);
  return {buffer.data(), written.ptr};
}

/// The bounds of `range`, as text behind the description of a time.
std::string in_words(Range<Duration> range) {
  std::string text;
  if (range.low > Duration{0}) text += ", of at least " + program::duration_text(range.low);
  if (range.high < Duration::max()) text += ", of at most " + program::duration_text(range.high);
  return text;
}

std::optional<Duration> read_duration(std::string_view text, Range<Duration> range) {
  const std::optional<Duration> duration = program::parse_duration(text);
  return duration && *duration >= range.low && *duration <= range.high ? duration : std::nullopt;
}

std::string_view without_blanks(std::string_view text) {
  const std::size_t begin = std::min(text.find_first_not_of(' '), text.size());
  return text.substr(begin, text.find_last_not_of(' ') + 1 - begin);
}

/// Equal for names that an environment variable's name can't distinguish.
std::string folded(std::string name) {
  for (char& c : name) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    if (c == '-' || c == '.') c = '_';
  }
  return name;
}

bool are_names(const Texts& names, std::size_t size_max) {
  constexpr const char* kLetters =
      "abcdefghijklmnopqrstuvwxyz0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ._-";
  Texts seen;
  for (const std::string& name : names) {
    if (name.empty() || name.size() > size_max ||
        name.find_first_not_of(kLetters) != std::string::npos ||
        std::ranges::find(seen, folded(name)) != seen.end())
      return false;
    seen.push_back(folded(name));
  }
  return !names.empty();
}

}  // namespace

Texts texts_of(const Setting& setting, std::string_view text) {
  if (!setting.is_list) return {std::string(text)};
  Texts items;
  for (std::size_t begin = 0; !text.empty() && begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    items.emplace_back(without_blanks(text.substr(begin, end - begin)));
    begin = end + 1;
  }
  return items;
}

Setting setting_of(std::string& value) {
  return setting_with(
      value, "TEXT", "a text", [](const std::string& text) { return std::optional(text); },
      [](const std::string& text) { return text; });
}

Setting setting_of(bool& value) {
  Setting setting = setting_with(
      value, "", "true or false",
      [](const std::string& text) {
        return text == "true" || text == "false" ? std::optional(text == "true") : std::nullopt;
      },
      [](bool is_on) { return is_on ? "true" : "false"; });
  setting.is_switch = true;
  setting.is_text = false;
  return setting;
}

template <class T>
Setting setting_of(T& value, Range<T> range) {
  std::string expected = std::is_integral_v<T> ? "a whole number" : "a number";
  if (range.high < std::numeric_limits<T>::max() || std::is_integral_v<T>)
    expected += " from " + number_text(range.low) + " to " + number_text(range.high);
  Setting setting = setting_with(
      value, "NUMBER", expected,
      [range](const std::string& text) { return read_number(text, range); }, number_text<T>);
  setting.is_text = std::is_same_v<T, std::uint64_t>;  // TOML's whole numbers end at 2^63 - 1.
  return setting;
}
template Setting setting_of(int&, Range<int>);
template Setting setting_of(std::uint16_t&, Range<std::uint16_t>);
template Setting setting_of(std::uint32_t&, Range<std::uint32_t>);
template Setting setting_of(std::uint64_t&, Range<std::uint64_t>);
template Setting setting_of(double&, Range<double>);

template <>
Setting setting_of(Duration& value, Range<Duration> range) {
  return setting_with(
      value, "TIME", "a time with a unit, such as 800us or 2s" + in_words(range),
      [range](const std::string& text) { return read_duration(text, range); },
      program::duration_text);
}

template <>
Setting setting_of(Priority& value, Range<Priority> range) {
  const Range<int> numbers{range.low.value(), range.high.value()};
  Setting setting = setting_with(
      value, "PRIORITY", "a priority, a whole number from 0 (least urgent) to 32767",
      [numbers](const std::string& text) -> std::optional<Priority> {
        const auto number = read_number(text, numbers);
        return number ? std::optional(Priority{*number}) : std::nullopt;
      },
      [](Priority priority) { return number_text(priority.value()); });
  setting.is_text = false;
  return setting;
}

Setting setting_of(std::vector<std::string>& value) {
  Setting setting;
  setting.is_list = true;
  setting.placeholder = "TEXT,TEXT";
  setting.expected = "a list with commas, without empty items";
  setting.read = [&value](const Texts& texts) {
    const bool is_valid = std::ranges::none_of(texts, &std::string::empty);
    if (is_valid) value = texts;
    return is_valid;
  };
  setting.write = [&value] { return value; };
  RTPM_ASSERT(texts_of(setting, program::joined(value, ",")) == value,
              "a list's default has items that are not empty and hold no comma or outer blank");
  return setting;
}

Setting setting_of(std::vector<int>& value) {
  Setting setting;
  setting.is_list = true;
  setting.is_text = false;
  setting.placeholder = "NUMBER,NUMBER";
  setting.expected = "a list of numbers from 0 to 1023, with commas";
  setting.read = [&value](const Texts& texts) {
    std::vector<int> numbers;
    for (const std::string& text : texts) {
      const auto number = read_number(text, kCpus);
      if (!number) return false;
      numbers.push_back(*number);
    }
    value = std::move(numbers);
    return true;
  };
  setting.write = [&value] {
    Texts texts;
    for (const int number : value)
      texts.push_back(number_text(number));
    return texts;
  };
  return setting;
}

Setting setting_of(std::optional<Duration>& value, Range<Duration> range) {
  return setting_with(
      value, "off|TIME", "off, or a time with a unit, such as 20us" + in_words(range),
      [range](const std::string& text) {
        const std::optional<Duration> time = read_duration(text, range);
        return text == "off" || time ? std::optional(time) : std::nullopt;
      },
      [](const std::optional<Duration>& time) {
        return time ? program::duration_text(*time) : "off";
      });
}

Setting setting_of_names(std::vector<std::string>& value, std::size_t size_max) {
  Setting setting = setting_of(value);
  setting.placeholder = "NAME,NAME";
  setting.expected = "a list of different names of letters, digits, '.', '_' and '-', of up to " +
                     number_text(size_max) + " bytes each";
  setting.read = [read = setting.read, size_max](const Texts& names) {
    return are_names(names, size_max) && read(names);
  };
  return setting;
}

Setting setting_of_choice(const Texts& choices, std::function<void(const std::string&)> read,
                          std::function<std::string()> write) {
  Setting setting;
  setting.placeholder = program::joined(choices, "|");
  setting.expected = program::joined(choices);
  if (const std::size_t last = setting.expected.rfind(", "); last != std::string::npos)
    setting.expected.replace(last, 2, " or ");
  setting.read = [choices, apply = std::move(read)](const Texts& texts) {
    if (texts.size() != 1 || std::ranges::find(choices, texts.front()) == choices.end())
      return false;
    apply(texts.front());
    return true;
  };
  RTPM_ASSERT(std::ranges::find(choices, write()) != choices.end(),
              "the default is one of the choices");
  setting.write = [write = std::move(write)] { return Texts{write()}; };
  return setting;
}

}  // namespace rtpm::options
