#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace rtpm::access {

/// What an identity may do with an object. Each role includes those before it.
enum class Role : std::uint8_t {
  kNone,
  kObserve,     ///< Reads, subscribes, describes.
  kCommand,     ///< Moves and pushes: forces, poses, leases, events.
  kConfigure,   ///< Changes parameters, calibrates.
  kAdminister,  ///< Stops, takes leases away, binds names.
};

/// "observe", …; of kNone "none".
[[nodiscard]] std::string_view to_string(Role role) noexcept;
/// The role of this name; nothing for "none" and unknown names.
[[nodiscard]] std::optional<Role> role_named(std::string_view name) noexcept;

}  // namespace rtpm::access
