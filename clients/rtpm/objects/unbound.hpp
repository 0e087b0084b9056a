#pragma once

#include <string>

#include "cli/context.hpp"

namespace rtpm::tool {

/// Explains why `target` was not reached: `error`, or the registry's answer if it does not have the
/// name or does not answer, with similar names. For a lost name, states since when.
[[nodiscard]] SetupError with_similar_names(Context& context, const std::string& target,
                                            SetupError error);

/// Explains why a name is not bound: `error`, or that its server is lost.
[[nodiscard]] SetupError with_loss(Context& context, const std::string& name, SetupError error);

}  // namespace rtpm::tool
