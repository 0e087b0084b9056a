#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "rtpm/base/time.hpp"
#include "rtpm/names/property.hpp"

namespace rtpm::names {

/// The owner of a name. A restart keeps the id and increases the epoch, so a restarted owner
/// regains its names at once, and no other owner can do so by accident.
struct Owner {
  std::uint64_t id = 0;  ///< Never 0.
  std::uint64_t epoch = 0;
  friend bool operator==(const Owner&, const Owner&) = default;
};

/// A request to bind a name.
struct Claim {
  std::string_view name;
  std::string_view url;
  std::string_view interface;
  Owner owner{};
  Duration lease{};
  /// Lets rebind() take the name from the holder with this revision; 0 for none.
  std::uint64_t holder_revision = 0;
  /// Lets rebind() take the name from any holder.
  bool allows_takeover = false;
  /// Set by the registry: the calling host (rpc::CallerHost::number).
  std::uint64_t host = 0;
  /// The properties, which replace those of an earlier bind.
  std::span<const Property> properties{};
  /// The name has no lease: it stays until it is unbound, even across restarts of a registry with a
  /// file.
  bool is_permanent = false;
};

/// Result of a bind.
struct Granted {
  /// Permanent names: Duration::max(). Other names: as requested, but at most
  /// Limits::first_lease_max until the name has been held for that long.
  Duration lease{};
  std::uint64_t revision = 0;
};

}  // namespace rtpm::names
