#pragma once

#include <string>

#include "cli/context.hpp"

namespace rtpm::tool {

/// Explains why `target` was not reached: returns `error` or, if the registry does not have the
/// name or does not answer, the registry's answer with similar names. For a lost name, also states
/// since when it has been lost.
[[nodiscard]] SetupError with_similar_names(Context& context, const std::string& target,
                                            SetupError error);

/// Explains why a name is not bound: returns `error`, or that its server is lost.
[[nodiscard]] SetupError with_loss(Context& context, const std::string& name, SetupError error);

}  // namespace rtpm::tool
