#pragma once

#include <string>

#include "cli/context.hpp"

namespace rtpm::tool {

/// Why `target` was not reached: `error` or, where the registry does not have the name or does not
/// answer, what it says of it, with the names most like it.
[[nodiscard]] SetupError with_similar_names(Context& context, const std::string& target,
                                            SetupError error);

}  // namespace rtpm::tool
