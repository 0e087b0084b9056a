#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace rtpm::driver {

/// Type of a parameter; wire numbers.
enum class ParameterType : std::uint8_t {
  kBool = 0,
  kInteger = 1,
  kReal = 2,
  kText = 3,
  kChoice = 4,  ///< One of ParameterSpec::choices.
  kVector = 5,  ///< ParameterSpec::vector_size reals.
};
inline constexpr std::uint8_t kParameterTypeCount = 6;
/// "bool", "integer", "real", "text", "choice", "vector".
[[nodiscard]] std::string_view to_string(ParameterType type) noexcept;

/// When a parameter may change; wire numbers.
enum class Mutability : std::uint8_t {
  kAnyTime = 0,   ///< Even while the device is active.
  kInactive = 1,  ///< Only while the device is not active.
  kReadOnly = 2,  ///< Never by a client.
};
inline constexpr std::uint8_t kMutabilityCount = 3;
/// "any time", "inactive", "read-only".
[[nodiscard]] std::string_view to_string(Mutability mutability) noexcept;

/// A value: bool for kBool, std::int64_t for kInteger, double for kReal, std::string for kText and
/// kChoice, std::vector<double> for kVector.
using ParameterValue = std::variant<bool, std::int64_t, double, std::string, std::vector<double>>;

inline constexpr std::size_t kParameterCountMax = 128;       ///< Per device.
inline constexpr std::size_t kParameterNameSizeMax = 63;     ///< In bytes.
inline constexpr std::size_t kParameterTextSizeMax = 255;    ///< In bytes.
inline constexpr std::size_t kParameterChoiceCountMax = 32;  ///< Per parameter.
inline constexpr std::size_t kParameterVectorSizeMax = 64;

/// Self-description of a parameter, for programs that have no prior knowledge of it.
/// @ownership a value
struct ParameterSpec {
  /// Lower-case words, digits and '_', grouped by dots, with the unit at the end:
  /// "encoder.offset_m". "safety." is the device server's own group.
  std::string name;
  ParameterType type = ParameterType::kReal;
  std::string unit{};  ///< SI, "1" for a ratio; empty if it has none.
  /// Range of an integer, a real, and each element of a vector; both ends included. The ends of an
  /// integer's range are whole numbers of at most 2^53.
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  std::vector<std::string> choices{};  ///< The words of a kChoice.
  std::size_t vector_size = 0;         ///< The size of a kVector.
  /// The initial value. It has the stated type and lies within the range.
  ParameterValue default_value{};
  std::string description{};  ///< One sentence.
  Mutability mutability = Mutability::kAnyTime;
};

/// A parameter's name and value.
struct ParameterSetting {
  std::string name;
  ParameterValue value{};
  friend bool operator==(const ParameterSetting&, const ParameterSetting&) = default;
};

/// Result of check().
enum class ValueFault : std::uint8_t {
  kNone,
  kWrongType,
  /// Includes: not finite, no such choice, a wrong vector size, a text that is too long.
  kOutOfRange,
};
/// Checks `value` against `spec`; ignores its mutability.
[[nodiscard]] ValueFault check(const ParameterSpec& spec, const ParameterValue& value) noexcept;

/// The fault of a specification, as a clause; empty if it has none.
/// @realtime set-up only
[[nodiscard]] std::string fault_of(const ParameterSpec& spec);

}  // namespace rtpm::driver
