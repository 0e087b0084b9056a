#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/names/claim.hpp"

namespace rtpm::names {

/// One bound name. Storages do not store what a renewal changes.
struct Record {
  std::string name;
  std::string url;
  std::string interface;
  Owner owner{};
  MonotonicTime expires{};  ///< When its lease ends, unless renewed.
  /// A number that changes with the holder of the name.
  std::uint64_t revision = 0;
  MonotonicTime bound{};   ///< When it was bound by its owner's current run.
  std::uint64_t host = 0;  ///< See Claim::host.
  std::vector<Property> properties{};
  /// Revision of the last change other than a renewal; shares its numbering with the holders'
  /// revisions.
  std::uint64_t change = 0;
  Duration lease{};  ///< The last granted lease; 0 if permanent.
  Duration stay{};   ///< See StoredName::stay.

  [[nodiscard]] bool is_permanent() const noexcept { return lease == Duration{0}; }
};

/// Whether a host's number, see rpc::CallerHost, is a loopback address.
[[nodiscard]] constexpr bool is_own_host(std::uint64_t host) noexcept {
  return host >> 24 == 127;
}

/// A host's number, with all loopback addresses mapped to one.
[[nodiscard]] constexpr std::uint64_t own_host_as_one(std::uint64_t host) noexcept {
  constexpr std::uint64_t kOwnHost = 0x7f00'0001;
  return is_own_host(host) ? kOwnHost : host;
}

}  // namespace rtpm::names
