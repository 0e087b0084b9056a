#include "rtpm/transport/socket_users.hpp"

#include <algorithm>

#include "os/native_socket.hpp"

namespace rtpm::transport {

bool is_trusted_user(std::uint32_t user, std::span<const std::uint32_t> others) noexcept {
  return os::is_own_or_root(user) || std::ranges::find(others, user) != others.end();
}

}  // namespace rtpm::transport
