#pragma once

#include <cstdint>
#include <string_view>

#include "rtpm/base/time.hpp"

namespace rtpm::names {

/// Who binds a name. The id stays the same when the owner restarts, the epoch grows with every
/// start: so a restarted owner takes its names over at once, and nobody else does by accident.
struct Owner {
  std::uint64_t id = 0;  ///< Never 0.
  std::uint64_t epoch = 0;
  friend bool operator==(const Owner&, const Owner&) = default;
};

/// What a name is to be bound to.
struct Claim {
  std::string_view name;
  std::string_view url;
  std::string_view interface;
  Owner owner{};
  Duration lease{};
  /// Of rebind(): whom it may take the name from. The holder with this revision, 0: none;
  std::uint64_t holder_revision = 0;
  /// whoever holds it.
  bool allows_takeover = false;
  /// The host that asks (rpc::CallerHost::ipv4), as the registry sees it.
  std::uint32_t host = 0;
};

/// What became of a bind.
struct Granted {
  /// As asked for, or Limits::first_lease_max, which then holds for renewals, too, until the name
  /// has been held for so long.
  Duration lease{};
  std::uint64_t revision = 0;
  bool is_takeover = false;  ///< Another owner held the name.
};

}  // namespace rtpm::names
