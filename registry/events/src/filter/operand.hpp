#pragma once

#include <string>

#include "rtpm/base/expected.hpp"
#include "rtpm/events/filter.hpp"
#include "rtpm/events/scalar.hpp"

namespace rtpm::events {

/// The operand as a number of the field's kind, or why the field can't be compared so, in words.
[[nodiscard]] expected<Scalar, std::string> operand_for(ScalarType type, Comparison comparison,
                                                        const Scalar& operand);

}  // namespace rtpm::events
