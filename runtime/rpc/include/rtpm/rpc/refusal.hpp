#pragma once

#include <flatbuffers/flatbuffers.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>

#include "rtpm/base/bytes.hpp"
#include "rtpm/rpc/servant.hpp"
#include "rtpm/wire/status.hpp"

namespace rtpm::rpc {

/// Refuses a call with a sentence for the caller and the server's log, truncated to
/// wire::kRefusalTextSizeMax bytes.
/// @realtime alloc-free
/// @source   spec/hprotocol.md#hp-7-1
[[nodiscard]] DispatchResult refuse(wire::Status status, std::string_view text,
                                    MutableBytes reply) noexcept;

/// Refuses a request that does not have the method's type.
/// @param wanted  "a lab.Force of 24 bytes"
/// @realtime alloc-free
[[nodiscard]] DispatchResult refuse_request(std::string_view wanted, ConstBytes request,
                                            MutableBytes reply) noexcept;

/// Finds a number of a request that is outside its `rtpm_range`. Generated code joins the checks
/// with &&, so it stops at the first such number.
/// @threads  one
/// @realtime alloc-free
class RangeCheck {
 public:
  /// Whether a number is within its range. NaN is not.
  /// @param limits  the range with its unit, "-20 to 20 N"
  template <class T>
  [[nodiscard]] bool number(T value, double low, double high, std::string_view field,
                            std::string_view limits) noexcept {
    const auto number = static_cast<double>(value);
    if (low <= number && number <= high) return true;
    is_float_ = std::is_same_v<T, float>;
    return find(number, field, limits);
  }
  /// Whether an optional number is absent or within its range.
  template <class T>
  [[nodiscard]] bool number(const flatbuffers::Optional<T>& value, double low, double high,
                            std::string_view field, std::string_view limits) noexcept {
    return !value || number(*value, low, high, field, limits);
  }
  /// Whether every number of a vector or array is within its range; true if the vector is absent.
  template <class Numbers>
  [[nodiscard]] bool numbers(const Numbers* numbers, double low, double high,
                             std::string_view field, std::string_view limits) noexcept {
    for (flatbuffers::uoffset_t i = 0; numbers != nullptr && i < numbers->size(); ++i) {
      if (!number(numbers->Get(i), low, high, {}, limits)) return within(field, i);
    }
    return true;
  }
  /// Whether `holds` is true of every struct or table of a vector or array; true if it is absent.
  template <class Items, class Predicate>
  [[nodiscard]] bool items(const Items* items, std::string_view field, Predicate holds) noexcept {
    for (flatbuffers::uoffset_t i = 0; items != nullptr && i < items->size(); ++i) {
      if (!holds(item_of(items->Get(i)))) return within(field, i);
    }
    return true;
  }
  /// Checks a vector of unions like items(); calls `holds` with each member's type and address.
  template <class Type, class Types, class Items, class Predicate>
  [[nodiscard]] bool members(const Types* types, const Items* items, std::string_view field,
                             Predicate holds) noexcept {
    for (flatbuffers::uoffset_t i = 0; items != nullptr && types != nullptr && i < items->size();
         ++i) {
      if (!holds(static_cast<Type>(types->Get(i)), items->Get(i))) return within(field, i);
    }
    return true;
  }
  /// Records that the offending number is in this field.
  /// @return false
  bool within(std::string_view field) noexcept;

  /// Refuses the call because of the offending number: "force.x is 30, but must be -20 to 20 N".
  [[nodiscard]] DispatchResult refuse(MutableBytes reply) const noexcept;

 private:
  /// An element of a vector or array; FlatBuffers returns a pointer or a reference.
  template <class T>
  [[nodiscard]] static const T& item_of(const T& item) noexcept {
    return item;
  }
  template <class T>
  [[nodiscard]] static const T& item_of(const T* item) noexcept {
    return *item;
  }
  bool find(double number, std::string_view field, std::string_view limits) noexcept;
  bool within(std::string_view field, std::uint32_t index) noexcept;
  void prepend(std::string_view text) noexcept;

  double number_ = 0;
  bool is_float_ = false;  ///< Printed with fewer digits.
  std::string_view limits_{};
  /// The path to the number, built from the inside out and so stored at the end of the array. Left
  /// uninitialised, so that calls within their ranges do not pay for it.
  std::array<char, 120> path_;
  std::size_t path_size_ = 0;
};

}  // namespace rtpm::rpc
