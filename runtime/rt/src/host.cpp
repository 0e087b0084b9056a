#include "rtpm/rt/host.hpp"

#include "rtpm/base/hash.hpp"

namespace rtpm::rt {

// hp-4.1-7
std::uint64_t clock_domain_of(std::string_view boot_id, std::string_view time_namespace) noexcept {
  return fnv1a_64(time_namespace, fnv1a_64(boot_id));
}

}  // namespace rtpm::rt
