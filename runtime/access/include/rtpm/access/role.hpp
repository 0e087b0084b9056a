#pragma once

#include <optional>
#include <string_view>

#include "rtpm/base/role.hpp"

namespace rtpm::access {

/// "observe", …; "none" for kNone.
[[nodiscard]] std::string_view to_string(Role role) noexcept;
/// The role with this name; nullopt for "none" and unknown names.
[[nodiscard]] std::optional<Role> role_named(std::string_view name) noexcept;

}  // namespace rtpm::access
