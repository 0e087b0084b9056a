#pragma once

#include <chrono>
#include <cstddef>

#include "rtpm/base/time.hpp"

namespace rtpm::names {

/// What a store takes in, and no more.
struct Limits {
  std::size_t name_count_max = 4096;
  std::size_t name_count_per_owner_max = 256;
  /// Of one other host, and the owners that it may have names of.
  std::size_t name_count_per_host_max = 512;
  std::size_t owner_count_per_host_max = 128;
  /// The same of the registry's own host, which may have more.
  std::size_t name_count_own_host_max = 2048;
  std::size_t owner_count_own_host_max = 512;
  Duration lease_min = std::chrono::milliseconds{100};
  Duration lease_max = std::chrono::hours{1};
  /// The longest lease of a name until it has been held for as long: so what nobody renews is gone
  /// soon, however long a lease it asked for.
  Duration first_lease_max = std::chrono::seconds{10};
};

}  // namespace rtpm::names
