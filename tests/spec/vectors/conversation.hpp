#pragma once

#include <string>

#include "vectors.hpp"

namespace rtpm::spec {

enum class Role { kClient, kServer };

/// Plays a conversation of spec/vectors/conversations/ with our code as one side: gives that side
/// everything that it gets in the steps. spec/vectors/README.md explains the steps. Returns "" if
/// the side does exactly its steps; otherwise the first step where it does not, and its action
/// instead.
[[nodiscard]] std::string play(const Json& conversation, Role role);

}  // namespace rtpm::spec
