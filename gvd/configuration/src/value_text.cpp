#include "rtpm/configuration/value_text.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <type_traits>
#include <vector>

namespace rtpm::gvd {
namespace {

using driver::ParameterSpec;
using driver::ParameterType;
using driver::ParameterValue;

template <class Number>
std::string number_text(Number number) {
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), number);
  return {buffer.data(), end.ptr};
}

template <class Number>
std::optional<Number> parse_number(std::string_view text) {
  Number number{};
  const auto read = std::from_chars(text.data(), text.data() + text.size(), number);
  if (read.ec != std::errc{} || read.ptr != text.data() + text.size()) return std::nullopt;
  return number;
}

std::optional<std::vector<double>> parse_vector(std::string_view text) {
  std::vector<double> values;
  while (true) {
    const std::size_t comma = text.find(',');
    const auto value = parse_number<double>(text.substr(0, comma));
    if (!value) return std::nullopt;
    values.push_back(*value);
    if (comma == std::string_view::npos) return values;
    text.remove_prefix(comma + 1);
  }
}

template <class T>
std::optional<ParameterValue> value_of(std::optional<T> parsed) {
  if (!parsed) return std::nullopt;
  return ParameterValue(std::move(*parsed));
}

std::optional<ParameterValue> parse(ParameterType type, std::string_view text) {
  switch (type) {
    case ParameterType::kBool:
      if (text != "true" && text != "false") return std::nullopt;
      return ParameterValue(text == "true");
    case ParameterType::kInteger:
      return value_of(parse_number<std::int64_t>(text));
    case ParameterType::kReal:
      return value_of(parse_number<double>(text));
    case ParameterType::kText:
    case ParameterType::kChoice:
      return ParameterValue(std::string(text));
    case ParameterType::kVector:
      return value_of(parse_vector(text));
  }
  return std::nullopt;
}

std::string_view form_of(ParameterType type) noexcept {
  switch (type) {
    case ParameterType::kBool:
      return "true or false";
    case ParameterType::kInteger:
      return "a whole number such as 12";
    case ParameterType::kReal:
      return "a number such as 0.05";
    case ParameterType::kVector:
      return "numbers with commas between, such as 1,0,-2.5";
    case ParameterType::kText:
    case ParameterType::kChoice:
      break;
  }
  return "a text";
}

}  // namespace

std::string to_text(const ParameterValue& value) {
  return std::visit(
      [](const auto& held) -> std::string {
        using Held = std::decay_t<decltype(held)>;
        if constexpr (std::is_same_v<Held, bool>) {
          return held ? "true" : "false";
        } else if constexpr (std::is_same_v<Held, std::string>) {
          return held;
        } else if constexpr (std::is_same_v<Held, std::vector<double>>) {
          std::string text;
          for (const double element : held) {
            text += (text.empty() ? "" : ",") + number_text(element);
          }
          return text;
        } else {
          return number_text(held);
        }
      },
      value);
}

expected<ParameterValue, ConfigurationError> parse_value(const ParameterSpec& spec,
                                                         std::string_view text) {
  if (auto value = parse(spec.type, text)) return std::move(*value);
  return unexpected{
      ConfigurationError{ConfigurationOutcome::kWrongType,
                         spec.name,
                         {.what = spec.name + " can't be '" + std::string(text) + "'",
                          .why = "it is a parameter of type " + std::string(to_string(spec.type)),
                          .remedy = "give " + std::string(form_of(spec.type))}}};
}

std::string range_text(const ParameterSpec& spec) {
  if (spec.type == ParameterType::kChoice) {
    std::string text;
    for (const std::string& choice : spec.choices) {
      text += (text.empty() ? "" : " | ") + choice;
    }
    return text;
  }
  if (spec.type == ParameterType::kBool || spec.type == ParameterType::kText) return {};
  std::string text;
  if (std::isfinite(spec.low) && std::isfinite(spec.high)) {
    text = number_text(spec.low) + " to " + number_text(spec.high);
  } else if (std::isfinite(spec.low)) {
    text = "at least " + number_text(spec.low);
  } else if (std::isfinite(spec.high)) {
    text = "at most " + number_text(spec.high);
  }
  if (spec.type != ParameterType::kVector) return text;
  return std::to_string(spec.vector_size) + (text.empty() ? " numbers" : " of " + text);
}

}  // namespace rtpm::gvd
