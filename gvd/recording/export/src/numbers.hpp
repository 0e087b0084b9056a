#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/schema/model.hpp"

/// Numbers in the bytes of a verified FlatBuffer, as text that reads as the same number again.
namespace rtpm::exports {

/// The integer at `at`, which is none of the reals.
[[nodiscard]] std::int64_t integer_at(schema::BaseType type, const std::byte* at) noexcept;
/// Appends "1.5", "true", "nan".
void append_number(std::string& text, schema::BaseType type, const std::byte* at);
/// Appends the default of an absent field.
void append_default(std::string& text, const schema::Field& field);
/// Whether the number at `at` is one in JSON, which has no NaN or infinity.
[[nodiscard]] bool is_finite_at(schema::BaseType type, const std::byte* at) noexcept;

}  // namespace rtpm::exports
