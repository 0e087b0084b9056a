#pragma once

#include <string>

#include "cli/context.hpp"

namespace rtpm::tool {

/// Why `target` was not reached: `error` or, where the registry does not have the name or does not
/// answer, what it says of it, with the names most like it. Of a lost name, since when.
[[nodiscard]] SetupError with_similar_names(Context& context, const std::string& target,
                                            SetupError error);

/// Why a name is not bound: `error`, or that its server is lost.
[[nodiscard]] SetupError with_loss(Context& context, const std::string& name, SetupError error);

}  // namespace rtpm::tool
