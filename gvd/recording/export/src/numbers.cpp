#include "numbers.hpp"

#include <array>
#include <bit>
#include <charconv>
#include <cmath>

namespace rtpm::exports {
namespace {

using schema::BaseType;

template <class T>
void append(std::string& text, T value) {
  std::array<char, 32> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
  text.append(digits.data(), end);
}

double real_at(BaseType type, const std::byte* at) {
  return type == BaseType::kFloat ? std::bit_cast<float>(load_le<std::uint32_t>(at))
                                  : std::bit_cast<double>(load_le<std::uint64_t>(at));
}

bool is_real(BaseType type) {
  return type == BaseType::kFloat || type == BaseType::kDouble;
}

}  // namespace

std::int64_t integer_at(BaseType type, const std::byte* at) noexcept {
  switch (type) {
    case BaseType::kInt8:
      return std::bit_cast<std::int8_t>(load_le<std::uint8_t>(at));
    case BaseType::kInt16:
      return std::bit_cast<std::int16_t>(load_le<std::uint16_t>(at));
    case BaseType::kUint16:
      return load_le<std::uint16_t>(at);
    case BaseType::kInt32:
      return std::bit_cast<std::int32_t>(load_le<std::uint32_t>(at));
    case BaseType::kUint32:
      return load_le<std::uint32_t>(at);
    case BaseType::kInt64:
    case BaseType::kUint64:
      return std::bit_cast<std::int64_t>(load_le<std::uint64_t>(at));
    default:
      return load_le<std::uint8_t>(at);
  }
}

void append_number(std::string& text, BaseType type, const std::byte* at) {
  if (type == BaseType::kFloat) {
    append(text, std::bit_cast<float>(load_le<std::uint32_t>(at)));
  } else if (type == BaseType::kDouble) {
    append(text, real_at(type, at));
  } else if (type == BaseType::kUint64) {
    append(text, load_le<std::uint64_t>(at));
  } else if (type == BaseType::kBool) {
    text += integer_at(type, at) != 0 ? "true" : "false";
  } else {
    append(text, integer_at(type, at));
  }
}

void append_default(std::string& text, const schema::Field& field) {
  if (field.type.base == BaseType::kFloat) {
    append(text, static_cast<float>(field.default_real));
  } else if (field.type.base == BaseType::kDouble) {
    append(text, field.default_real);
  } else if (field.type.base == BaseType::kUint64) {
    append(text, static_cast<std::uint64_t>(field.default_integer));
  } else if (field.type.base == BaseType::kBool) {
    text += field.default_integer != 0 ? "true" : "false";
  } else {
    append(text, field.default_integer);
  }
}

bool is_finite_at(BaseType type, const std::byte* at) noexcept {
  return !is_real(type) || std::isfinite(real_at(type, at));
}

}  // namespace rtpm::exports
