#pragma once

#include <string>
#include <string_view>

#include "rtpm/schema/model.hpp"

/// How the model's enumerators are spelled in fingerprints, JSON and schemas. A change here changes
/// fingerprints.
namespace rtpm::schema {

[[nodiscard]] std::string_view spelling_of(BaseType type) noexcept;
[[nodiscard]] std::string_view spelling_of(PayloadKind kind) noexcept;
[[nodiscard]] std::string_view spelling_of(OnewayLevel level) noexcept;
[[nodiscard]] std::string_view spelling_of(Role role) noexcept;
[[nodiscard]] std::string_view spelling_of(PriorityModel model) noexcept;

/// A type as written in a schema: "[lab.Force]".
[[nodiscard]] std::string type_text(const Model& model, const Type& type);
/// The default of a number or enum as written in a schema: "0", "Follow", "null".
[[nodiscard]] std::string default_text(const Model& model, const Field& field);

}  // namespace rtpm::schema
