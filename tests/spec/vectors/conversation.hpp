#pragma once

#include <string>

#include "vectors.hpp"

namespace rtpm::spec {

enum class Role { kClient, kServer };

/// Plays a conversation of spec/vectors/conversations/ with our code as one side: gives that side
/// everything that the steps say it gets. How to read the steps is said in spec/vectors/README.md.
/// Gives "" if the side does what the steps say it does, no less and no more; else the first step
/// where it does not, and what it does instead.
[[nodiscard]] std::string play(const Json& conversation, Role role);

}  // namespace rtpm::spec
