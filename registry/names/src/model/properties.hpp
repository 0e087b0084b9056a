#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>

#include "model/record.hpp"
#include "rtpm/names/property.hpp"
#include "rtpm/predicate/operand.hpp"

namespace rtpm::names {

/// The index of the first property that is malformed, reserved, duplicate or beyond the limit;
/// nullopt if all are well-formed.
[[nodiscard]] std::optional<std::size_t> first_bad_property(std::span<const Property> properties);

/// The bytes that count towards the limits.
[[nodiscard]] std::size_t byte_count(std::span<const Property> properties) noexcept;

/// The names of the built-in properties, which every binding has.
[[nodiscard]] bool is_built_in(std::string_view name) noexcept;

/// A binding's properties, including the built-in ones.
/// @ownership refers to the record
class RecordProperties final : public predicate::PropertySource {
 public:
  explicit RecordProperties(const Record& record) noexcept : record_(record) {}
  [[nodiscard]] predicate::Operand find(std::string_view name) const noexcept override;

 private:
  const Record& record_;
};

}  // namespace rtpm::names
