#pragma once

#include <optional>

#include "expression.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/predicate/predicate.hpp"
#include "rtpm/predicate/text_error.hpp"

namespace rtpm::predicate {

/// The type of the whole expression; nullopt if it depends on properties whose type
/// `type_of_property` does not know.
/// @errors   an operand has a type that its operator does not accept
[[nodiscard]] expected<std::optional<Type>, TextError> check_types(
    const Nodes& nodes, const TypeOfProperty& type_of_property);

}  // namespace rtpm::predicate
