#include "setting.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <system_error>

#include "rtpm/base/assert.hpp"
#include "rtpm/options/duration.hpp"

namespace rtpm::options {
namespace {

constexpr Range<int> kCpus{0, 1023};

/// Parses all of `text` as a number; nothing if it is not one or out of range.
template <class T>
std::optional<T> read_number(std::string_view text, Range<T> range) {
  T number{};
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, number);
  // NaN fails both comparisons, so it is never in a range.
  if (read.ec != std::errc{} || read.ptr != end || !(number >= range.low && number <= range.high)) {
    return std::nullopt;
  }
  return number;
}

/// The shortest text that reads back as the same number.
template <class T>
std::string number_text(T number) {
  std::array<char, 32> buffer{};
  const auto written = std::to_chars(buffer.data(), buffer.data() + buffer.size(), number);
  return {buffer.data(), written.ptr};
}

template <class T>
Setting number_setting(T& value, Range<T> range, std::string_view kind) {
  Setting setting;
  setting.placeholder = "NUMBER";
  setting.expected.append(kind).append(" from ").append(number_text(range.low));
  setting.expected.append(" to ").append(number_text(range.high));
  setting.read = [&value, range](std::string_view text) {
    const std::optional<T> number = read_number(text, range);
    if (number) value = *number;
    return number.has_value();
  };
  setting.write = [&value] { return number_text(value); };
  return setting;
}

std::string joined(const std::vector<std::string>& items, std::string_view separator) {
  std::string text;
  for (const std::string& item : items) {
    if (&item != &items.front()) text += separator;
    text += item;
  }
  return text;
}

/// The items between commas, without the blanks around them; nothing if one is empty.
std::optional<std::vector<std::string>> read_list(std::string_view text) {
  std::vector<std::string> items;
  while (!text.empty()) {
    const std::size_t comma = text.find(',');
    std::string_view item = text.substr(0, comma);
    while (item.starts_with(' '))
      item.remove_prefix(1);
    while (item.ends_with(' '))
      item.remove_suffix(1);
    if (item.empty() || comma == text.size() - 1) return std::nullopt;
    items.emplace_back(item);
    text = comma == std::string_view::npos ? std::string_view{} : text.substr(comma + 1);
  }
  return items;
}

/// The number of letters to insert, delete, replace or swap with their neighbour to turn `from`
/// into `to` (the distance of Damerau and Levenshtein, restricted form).
std::size_t slip_count(std::string_view from, std::string_view to) {
  std::vector<std::vector<std::size_t>> cost(from.size() + 1,
                                             std::vector<std::size_t>(to.size() + 1));
  for (std::size_t i = 0; i <= from.size(); ++i) {
    for (std::size_t k = 0; k <= to.size(); ++k) {
      if (i == 0 || k == 0) {
        cost[i][k] = i + k;
        continue;
      }
      cost[i][k] = std::min({cost[i - 1][k] + 1, cost[i][k - 1] + 1,
                             cost[i - 1][k - 1] + (from[i - 1] == to[k - 1] ? 0U : 1U)});
      if (i > 1 && k > 1 && from[i - 1] == to[k - 2] && from[i - 2] == to[k - 1]) {
        cost[i][k] = std::min(cost[i][k], cost[i - 2][k - 2] + 1);
      }
    }
  }
  return cost[from.size()][to.size()];
}

}  // namespace

Setting setting_of(std::string& value) {
  Setting setting;
  setting.placeholder = "TEXT";
  setting.expected = "a text";
  setting.read = [&value](std::string_view text) {
    value = text;
    return true;
  };
  setting.write = [&value] { return value; };
  return setting;
}

Setting setting_of(bool& value) {
  Setting setting;
  setting.is_switch = true;
  setting.expected = "true or false";
  setting.read = [&value](std::string_view text) {
    if (text != "true" && text != "false") return false;
    value = text == "true";
    return true;
  };
  setting.write = [&value] { return std::string(value ? "true" : "false"); };
  return setting;
}

Setting setting_of(int& value, Range<int> range) {
  return number_setting(value, range, "a whole number");
}
Setting setting_of(std::uint16_t& value, Range<std::uint16_t> range) {
  return number_setting(value, range, "a whole number");
}
Setting setting_of(std::uint32_t& value, Range<std::uint32_t> range) {
  return number_setting(value, range, "a whole number");
}
Setting setting_of(std::uint64_t& value, Range<std::uint64_t> range) {
  return number_setting(value, range, "a whole number");
}
Setting setting_of(double& value, Range<double> range) {
  return number_setting(value, range, "a number");
}

namespace {

/// The bounds of `range`, as text behind the description of a time.
std::string in_words(Range<Duration> range) {
  std::string text;
  if (range.low > Duration{0}) text += ", of at least " + duration_text(range.low);
  if (range.high < Duration::max()) text += ", of at most " + duration_text(range.high);
  return text;
}

}  // namespace

Setting setting_of(Duration& value, Range<Duration> range) {
  Setting setting;
  setting.placeholder = "TIME";
  setting.expected = "a time with a unit, such as 800us or 2s" + in_words(range);
  setting.read = [&value, range](std::string_view text) {
    const std::optional<Duration> duration = parse_duration(text);
    if (!duration || *duration < range.low || *duration > range.high) return false;
    value = *duration;
    return true;
  };
  setting.write = [&value] { return duration_text(value); };
  return setting;
}

Setting setting_of(Priority& value) {
  Setting setting;
  setting.placeholder = "PRIORITY";
  setting.expected = "a priority, a whole number from 0 (least urgent) to 32767";
  setting.read = [&value](std::string_view text) {
    const auto number = read_number<int>(text, {Priority::kLowest, Priority::kHighest});
    if (number) value = Priority{*number};
    return number.has_value();
  };
  setting.write = [&value] { return number_text(value.value()); };
  return setting;
}

Setting setting_of(std::vector<std::string>& value) {
  Setting setting;
  setting.placeholder = "TEXT,TEXT";
  setting.expected = "a list with commas, without empty items";
  setting.is_list = true;
  setting.read = [&value](std::string_view text) {
    std::optional<std::vector<std::string>> items = read_list(text);
    if (!items) return false;
    value = std::move(*items);
    return true;
  };
  setting.write = [&value] { return joined(value, ","); };
  RTPM_ASSERT(read_list(setting.write()) == value,
              "a list's default has items that are not empty and hold no comma or outer blank");
  return setting;
}

Setting setting_of(std::vector<int>& value) {
  Setting setting;
  setting.placeholder = "NUMBER,NUMBER";
  setting.expected = "a list of numbers from 0 to 1023, with commas";
  setting.is_list = true;
  setting.read = [&value](std::string_view text) {
    const auto items = read_list(text);
    if (!items) return false;
    std::vector<int> numbers;
    for (const std::string& item : *items) {
      const auto number = read_number(std::string_view(item), kCpus);
      if (!number) return false;
      numbers.push_back(*number);
    }
    value = std::move(numbers);
    return true;
  };
  setting.write = [&value] {
    std::vector<std::string> items;
    for (const int number : value)
      items.push_back(number_text(number));
    return joined(items, ",");
  };
  return setting;
}

Setting setting_of(std::optional<Duration>& value, Range<Duration> range) {
  Setting setting;
  setting.placeholder = "off|TIME";
  setting.expected = "off, or a time with a unit, such as 20us" + in_words(range);
  setting.read = [&value, range](std::string_view text) {
    const std::optional<Duration> duration = parse_duration(text);
    const bool is_in_range = duration && *duration >= range.low && *duration <= range.high;
    if (text != "off" && !is_in_range) return false;
    value = text == "off" ? std::nullopt : duration;
    return true;
  };
  setting.write = [&value] { return value ? duration_text(*value) : "off"; };
  return setting;
}

namespace {

/// Equal for names that an environment variable's name can't distinguish.
std::string folded(std::string name) {
  for (char& c : name) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    if (c == '-' || c == '.') c = '_';
  }
  return name;
}

}  // namespace

Setting setting_of_names(std::vector<std::string>& value, std::size_t size_max) {
  Setting setting = setting_of(value);
  setting.placeholder = "NAME,NAME";
  setting.expected = "a list of different names of letters, digits, '.', '_' and '-', of up to " +
                     number_text(size_max) + " bytes each";
  setting.read = [&value, size_max](std::string_view text) {
    auto names = read_list(text);
    if (!names || names->empty()) return false;
    constexpr const char* kLetters =
        "abcdefghijklmnopqrstuvwxyz0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ._-";
    std::vector<std::string> seen;
    for (const std::string& name : *names) {
      seen.push_back(folded(name));
      if (name.size() > size_max || name.find_first_not_of(kLetters) != std::string::npos ||
          std::find(seen.begin(), seen.end(), seen.back()) != seen.end() - 1) {
        return false;
      }
    }
    value = std::move(*names);
    return true;
  };
  return setting;
}

Setting setting_of_choice(const std::vector<std::string>& choices,
                          std::function<void(std::string_view)> read,
                          std::function<std::string()> write) {
  Setting setting;
  setting.placeholder = joined(choices, "|");
  setting.expected = joined(choices, ", ");
  if (const std::size_t last = setting.expected.rfind(", "); last != std::string::npos) {
    setting.expected.replace(last, 2, " or ");
  }
  setting.read = [choices, apply = std::move(read)](std::string_view text) {
    if (std::find(choices.begin(), choices.end(), text) == choices.end()) return false;
    apply(text);
    return true;
  };
  setting.write = std::move(write);
  RTPM_ASSERT(std::find(choices.begin(), choices.end(), setting.write()) != choices.end(),
              "the default is one of the choices");
  return setting;
}

std::string nearest(std::string_view word, const std::vector<std::string>& candidates) {
  // A typing error leaves most letters in place; a more distant candidate would be a guess.
  std::size_t best = std::max<std::size_t>(1, word.size() / 3) + 1;
  std::string found;
  for (const std::string& candidate : candidates) {
    // The distance costs the product of the lengths, and no key is that long.
    if (word.size() > 64) break;
    const std::size_t slips = slip_count(word, candidate);
    if (slips < best) {
      best = slips;
      found = candidate;
    }
  }
  return found;
}

}  // namespace rtpm::options
