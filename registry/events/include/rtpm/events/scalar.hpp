#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "rtpm/base/bytes.hpp"
#include "rtpm/events/event.hpp"

/// Numbers in payloads, which filters can read without generated code.
namespace rtpm::events {

/// The type of a number in a payload.
enum class ScalarType : std::uint8_t {
  kBool,
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat,
  kDouble,
};
inline constexpr int kScalarTypeCount = 11;

/// The type as a schema spells it: "bool", "int8", …, "double".
[[nodiscard]] std::string_view to_string(ScalarType type) noexcept;
[[nodiscard]] bool is_real(ScalarType type) noexcept;
[[nodiscard]] bool is_signed(ScalarType type) noexcept;
[[nodiscard]] std::size_t size_of(ScalarType type) noexcept;

/// A number, in the widest type of its kind.
struct Scalar {
  enum class Kind : std::uint8_t { kSigned, kUnsigned, kReal };
  Kind kind = Kind::kSigned;
  std::int64_t integer = 0;   ///< The value of a kSigned.
  std::uint64_t natural = 0;  ///< The value of a kUnsigned.
  double real = 0;            ///< The value of a kReal.

  [[nodiscard]] static constexpr Scalar of(std::int64_t value) noexcept {
    return {Kind::kSigned, value, 0, 0};
  }
  [[nodiscard]] static constexpr Scalar of(std::uint64_t value) noexcept {
    return {Kind::kUnsigned, 0, value, 0};
  }
  [[nodiscard]] static constexpr Scalar of(double value) noexcept {
    return {Kind::kReal, 0, 0, value};
  }
  [[nodiscard]] static constexpr Scalar of(int value) noexcept {
    return of(static_cast<std::int64_t>(value));
  }
  [[nodiscard]] static constexpr Scalar of(bool value) noexcept {
    return of(static_cast<std::uint64_t>(value));
  }
  [[nodiscard]] constexpr double as_real() const noexcept {
    return kind == Kind::kReal       ? real
           : kind == Kind::kUnsigned ? static_cast<double>(natural)
                                     : static_cast<double>(integer);
  }
  friend bool operator==(const Scalar&, const Scalar&) = default;
};

/// The location of a number in a payload: slots of nested tables, then an offset into the struct of
/// the last slot. Without slots the payload is a bare struct.
struct FieldPath {
  static constexpr std::size_t kSlotCountMax = 4;
  std::array<std::uint16_t, kSlotCountMax> slots{};
  std::uint8_t slot_count = 0;
  std::uint16_t offset = 0;  ///< In bytes.
  friend bool operator==(const FieldPath&, const FieldPath&) = default;
};

/// A number in an event's payload.
struct FieldDescriptor {
  std::string_view name{};  ///< Path through structs and tables: "pose.position_m.x".
  ScalarType type = ScalarType::kDouble;
  FieldPath path{};
  Scalar default_value{};  ///< The value if the table field is absent.
};

/// The schema of one event type. Generated code has a constant with static lifetime for each.
struct EventDescriptor {
  EventType type = 0;
  std::string_view name{};  ///< Fully qualified, "lab.Pose".
  std::uint64_t schema_id = 0;
  std::span<const FieldDescriptor> fields{};  ///< All numbers, in any order.
  /// A FlatBuffers schema without includes, whose root type is the event; empty if unknown.
  std::string_view schema{};
};

/// Reads a number from an untrusted payload; nullopt if it would lie outside the payload.
/// @realtime alloc-free
[[nodiscard]] std::optional<Scalar> read_scalar(ConstBytes payload, const FieldPath& path,
                                                ScalarType type,
                                                const Scalar& default_value) noexcept;

}  // namespace rtpm::events
