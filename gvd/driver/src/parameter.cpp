#include "rtpm/driver/parameter.hpp"

#include <algorithm>
#include <cmath>

namespace rtpm::driver {
namespace {

constexpr double kIntegerEndMax = 9007199254740992.0;  // 2^53: exact as a double.

bool is_within(const ParameterSpec& spec, double value) noexcept {
  return std::isfinite(value) && value >= spec.low && value <= spec.high;
}

ValueFault check_integer(const ParameterSpec& spec, std::int64_t value) noexcept {
  const auto number = static_cast<double>(value);
  return number >= spec.low && number <= spec.high ? ValueFault::kNone : ValueFault::kOutOfRange;
}

ValueFault check_vector(const ParameterSpec& spec, const std::vector<double>& values) noexcept {
  const bool is_good =
      values.size() == spec.vector_size &&
      std::ranges::all_of(values, [&](double value) { return is_within(spec, value); });
  return is_good ? ValueFault::kNone : ValueFault::kOutOfRange;
}

ValueFault check_text(const ParameterSpec& spec, const std::string& text) noexcept {
  const bool is_good = spec.type == ParameterType::kChoice
                           ? std::ranges::find(spec.choices, text) != spec.choices.end()
                           : text.size() <= kParameterTextSizeMax;
  return is_good ? ValueFault::kNone : ValueFault::kOutOfRange;
}

bool is_name(std::string_view name) noexcept {
  if (name.empty() || name.size() > kParameterNameSizeMax) return false;
  char before = '.';
  for (const char c : name) {
    const bool is_word = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
    if (!is_word && (c != '.' || before == '.')) return false;
    before = c;
  }
  return before != '.';
}

bool is_whole_end(double end) noexcept {
  return std::isinf(end) || (std::trunc(end) == end && std::abs(end) <= kIntegerEndMax);
}

}  // namespace

std::string_view to_string(ParameterType type) noexcept {
  switch (type) {
    case ParameterType::kBool:
      return "bool";
    case ParameterType::kInteger:
      return "integer";
    case ParameterType::kReal:
      return "real";
    case ParameterType::kText:
      return "text";
    case ParameterType::kChoice:
      return "choice";
    case ParameterType::kVector:
      return "vector";
  }
  return "unknown";
}

std::string_view to_string(Mutability mutability) noexcept {
  switch (mutability) {
    case Mutability::kAnyTime:
      return "any time";
    case Mutability::kInactive:
      return "inactive";
    case Mutability::kReadOnly:
      return "read-only";
  }
  return "unknown";
}

ValueFault check(const ParameterSpec& spec, const ParameterValue& value) noexcept {
  switch (spec.type) {
    case ParameterType::kBool:
      return std::holds_alternative<bool>(value) ? ValueFault::kNone : ValueFault::kWrongType;
    case ParameterType::kInteger:
      if (const auto* number = std::get_if<std::int64_t>(&value)) {
        return check_integer(spec, *number);
      }
      return ValueFault::kWrongType;
    case ParameterType::kReal:
      if (const auto* number = std::get_if<double>(&value)) {
        return is_within(spec, *number) ? ValueFault::kNone : ValueFault::kOutOfRange;
      }
      return ValueFault::kWrongType;
    case ParameterType::kText:
    case ParameterType::kChoice:
      if (const auto* text = std::get_if<std::string>(&value)) return check_text(spec, *text);
      return ValueFault::kWrongType;
    case ParameterType::kVector:
      if (const auto* values = std::get_if<std::vector<double>>(&value)) {
        return check_vector(spec, *values);
      }
      return ValueFault::kWrongType;
  }
  return ValueFault::kWrongType;
}

std::string fault_of(const ParameterSpec& spec) {
  if (!is_name(spec.name)) {
    return "its name is not lower-case words, digits and '_' grouped by dots, of at most " +
           std::to_string(kParameterNameSizeMax) + " bytes";
  }
  if (std::isnan(spec.low) || std::isnan(spec.high) || spec.low > spec.high) {
    return "its range has no values";
  }
  if (spec.type == ParameterType::kInteger &&
      !(is_whole_end(spec.low) && is_whole_end(spec.high))) {
    return "its range does not end at whole numbers of at most 2^53";
  }
  if (spec.type == ParameterType::kChoice &&
      (spec.choices.empty() || spec.choices.size() > kParameterChoiceCountMax)) {
    return "it has no choices, or more than " + std::to_string(kParameterChoiceCountMax);
  }
  if (!std::ranges::all_of(spec.choices, [](const std::string& choice) {
        return !choice.empty() && choice.size() <= kParameterTextSizeMax;
      })) {
    return "it has an empty or too long choice";
  }
  if (spec.type == ParameterType::kVector &&
      (spec.vector_size == 0 || spec.vector_size > kParameterVectorSizeMax)) {
    return "its vector has no elements, or more than " + std::to_string(kParameterVectorSizeMax);
  }
  switch (check(spec, spec.default_value)) {
    case ValueFault::kWrongType:
      return "its default is not of type " + std::string(to_string(spec.type));
    case ValueFault::kOutOfRange:
      return "its default is out of range";
    case ValueFault::kNone:
      break;
  }
  return {};
}

}  // namespace rtpm::driver
