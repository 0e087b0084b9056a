#pragma once

#include <string_view>

#include "rtpm/schema/model.hpp"

/// How the model's enumerators are written in fingerprints, JSON and schemas. A change of one of
/// them changes fingerprints.
namespace rtpm::schema {

[[nodiscard]] std::string_view spelling_of(BaseType type) noexcept;
[[nodiscard]] std::string_view spelling_of(PayloadKind kind) noexcept;
[[nodiscard]] std::string_view spelling_of(OnewayLevel level) noexcept;
[[nodiscard]] std::string_view spelling_of(PriorityModel model) noexcept;

}  // namespace rtpm::schema
