#pragma once

#include <cstddef>
#include <string_view>

#include "expression.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/predicate/text_error.hpp"

namespace rtpm::predicate {

/// Reads an expression; an empty text results in no nodes.
/// @errors   the text is malformed, or exceeds a limit of predicates
[[nodiscard]] expected<Nodes, TextError> parse_expression(std::string_view text);

}  // namespace rtpm::predicate
