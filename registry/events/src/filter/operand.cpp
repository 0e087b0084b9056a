#include "filter/operand.hpp"

#include <cmath>
#include <limits>

namespace rtpm::events {
namespace {

std::string in_words(const Scalar& scalar) {
  switch (scalar.kind) {
    case Scalar::Kind::kSigned:
      return std::to_string(scalar.integer);
    case Scalar::Kind::kUnsigned:
      return std::to_string(scalar.natural);
    case Scalar::Kind::kReal:
      break;
  }
  return std::to_string(scalar.real);
}

unexpected<SetupError> no_value(ScalarType type, const Scalar& operand) {
  return setup_error(in_words(operand) + " is none of the values of " +
                     std::string(to_string(type)));
}

std::int64_t lowest(ScalarType type) noexcept {
  if (!is_signed(type)) return 0;
  return std::numeric_limits<std::int64_t>::min() >> (64 - 8 * size_of(type));
}

std::uint64_t highest(ScalarType type) noexcept {
  if (type == ScalarType::kBool) return 1;
  const std::uint64_t all = std::numeric_limits<std::uint64_t>::max() >> (64 - 8 * size_of(type));
  return is_signed(type) ? all / 2 : all;
}

// Converts a whole real number to an integer; nullopt if it is not whole.
std::optional<Scalar> whole(double real) noexcept {
  if (std::trunc(real) != real) return std::nullopt;
  if (real >= -0x1p63 && real < 0x1p63) return Scalar::of(static_cast<std::int64_t>(real));
  if (real >= 0 && real < 0x1p64) return Scalar::of(static_cast<std::uint64_t>(real));
  return std::nullopt;
}

}  // namespace

expected<Scalar, SetupError> operand_for(ScalarType type, Comparison comparison,
                                         const Scalar& operand) {
  if (is_real(type)) {
    if (comparison == Comparison::kHasAnyBit) {
      return setup_error(std::string(to_string(type)) + " has no bits");
    }
    const double real = operand.as_real();
    if (std::isnan(real)) return setup_error("nothing compares with NaN");
    // Rounded to the field's precision, so that 0.1 equals a float of 0.1.
    return Scalar::of(type == ScalarType::kFloat ? double{static_cast<float>(real)} : real);
  }
  const bool is_order = comparison != Comparison::kEqual && comparison != Comparison::kNotEqual;
  if (type == ScalarType::kBool && is_order) {
    return setup_error("bool is compared with == and != only");
  }
  Scalar integer = operand;
  if (operand.kind == Scalar::Kind::kReal) {
    const auto found = whole(operand.real);
    if (!found) return no_value(type, operand);
    integer = *found;
  }
  const bool is_negative = integer.kind == Scalar::Kind::kSigned && integer.integer < 0;
  const auto magnitude = integer.kind == Scalar::Kind::kSigned
                             ? static_cast<std::uint64_t>(integer.integer)
                             : integer.natural;
  if (is_negative ? integer.integer < lowest(type) : magnitude > highest(type)) {
    return no_value(type, operand);
  }
  return is_signed(type) ? Scalar::of(static_cast<std::int64_t>(magnitude)) : Scalar::of(magnitude);
}

}  // namespace rtpm::events
