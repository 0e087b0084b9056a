#include <algorithm>
#include <string_view>

#include "rtpm/base/hash.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"

namespace rtpm::names {
namespace {

/// The epoch: the time of the first call. Monotonic on one host; the clock's identity is part of
/// the owner's id.
std::uint64_t epoch_of_this_start() {
  static const auto epoch = static_cast<std::uint64_t>(to_ns(rt::now()));
  return epoch;
}

/// The clock's identity; random if unknown, so that no other owner is mistaken for an earlier run
/// of this one.
std::uint64_t clock_identity() {
  static const std::uint64_t identity =
      rt::clock_domain() != 0 ? rt::clock_domain() : rt::random_u64();
  return identity;
}

}  // namespace

Owner owner_of(std::string_view url) {
  // Without the path: all objects of a server have the same owner.
  const std::size_t authority = url.find("://") == std::string_view::npos ? 0 : url.find("://") + 3;
  const std::string_view server = url.substr(0, url.find('/', authority));
  const std::uint64_t id = fnv1a_64(server, clock_identity());
  return {.id = std::max<std::uint64_t>(id, 1), .epoch = epoch_of_this_start()};
}

}  // namespace rtpm::names
