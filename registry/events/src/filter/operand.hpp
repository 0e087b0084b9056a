#pragma once

#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/events/filter.hpp"
#include "rtpm/events/scalar.hpp"

namespace rtpm::events {

/// Converts the operand to the field's kind, or explains why the comparison is invalid.
[[nodiscard]] expected<Scalar, SetupError> operand_for(ScalarType type, Comparison comparison,
                                                       const Scalar& operand);

}  // namespace rtpm::events
