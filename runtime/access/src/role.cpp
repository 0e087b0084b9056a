#include "rtpm/access/role.hpp"

#include <array>

namespace rtpm::access {
namespace {

constexpr std::array<std::string_view, 5> kNames{"none", "observe", "command", "configure",
                                                 "administer"};

}  // namespace

std::string_view to_string(Role role) noexcept {
  return kNames[static_cast<std::size_t>(role)];
}

std::optional<Role> role_named(std::string_view name) noexcept {
  for (std::size_t index = 1; index < kNames.size(); ++index) {
    if (kNames[index] == name) return static_cast<Role>(index);
  }
  return std::nullopt;
}

}  // namespace rtpm::access
