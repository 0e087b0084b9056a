#include "rtpm/transport/socket_users.hpp"

#include "bsd_sockets.hpp"
// Behind Winsock's header.
#include <iphlpapi.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <vector>

namespace rtpm::transport {
namespace {

constexpr std::uint32_t kOwnOrSystem = 0;

class Handle {
 public:
  explicit Handle(HANDLE handle) noexcept : handle_(handle) {}
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  ~Handle() {
    if (handle_ != nullptr) CloseHandle(handle_);
  }
  [[nodiscard]] HANDLE get() const noexcept { return handle_; }

 private:
  HANDLE handle_;
};

/// A user's id, behind the structure that points to it.
struct User {
  alignas(TOKEN_USER) std::array<std::byte, sizeof(TOKEN_USER) + SECURITY_MAX_SID_SIZE> bytes{};
  [[nodiscard]] PSID id() noexcept { return reinterpret_cast<TOKEN_USER*>(bytes.data())->User.Sid; }
};

/// False if this user may not see it.
bool read_user(HANDLE process, User& user) noexcept {
  HANDLE token = nullptr;
  if (process == nullptr || OpenProcessToken(process, TOKEN_QUERY, &token) == 0) return false;
  const Handle closed(token);
  DWORD size = 0;
  return GetTokenInformation(token, TokenUser, user.bytes.data(),
                             static_cast<DWORD>(user.bytes.size()), &size) != 0;
}

/// The last part of another user's id, which tells those of one machine apart; nullopt if this user
/// may not see it.
std::optional<std::uint32_t> user_of(DWORD process_id) noexcept {
  const Handle process(OpenProcess(PROCESS_QUERY_LIMITED_INFORMATION, FALSE, process_id));
  User own;
  User user;
  if (!read_user(GetCurrentProcess(), own) || !read_user(process.get(), user)) return std::nullopt;
  if (EqualSid(own.id(), user.id()) != 0 || IsWellKnownSid(user.id(), WinLocalSystemSid) != 0)
    return kOwnOrSystem;
  const UCHAR count = *GetSidSubAuthorityCount(user.id());
  if (count == 0) return std::nullopt;
  return *GetSidSubAuthority(user.id(), count - 1U);
}

/// The table that `get` writes into a buffer of enough size; nullopt if the system refuses.
template <class Get>
std::optional<std::vector<std::byte>> table_of(Get get) {
  std::vector<std::byte> table;
  DWORD size = 0;
  DWORD status = get(nullptr, &size);
  constexpr int kTryCount = 8;  // The table may grow meanwhile.
  for (int i = 0; i < kTryCount && status == ERROR_INSUFFICIENT_BUFFER; ++i) {
    table.resize(size);
    status = get(table.data(), &size);
  }
  return status == NO_ERROR ? std::optional(std::move(table)) : std::nullopt;
}

template <class Row>
bool is_at(const Row& row, const SocketAddress& address) noexcept {
  if (ntohs(static_cast<u_short>(row.dwLocalPort)) != address.port()) return false;
  if constexpr (requires { row.dwLocalAddr; }) {
    return address.is_ipv4() &&
           (row.dwLocalAddr == INADDR_ANY || ntohl(row.dwLocalAddr) == address.ipv4());
  } else {
    constexpr SocketAddress::Ipv6 kAny{};
    // "::" counts as accepting IPv4, too, as the setting is not visible from outside.
    if (std::memcmp(row.ucLocalAddr, kAny.data(), kAny.size()) == 0) return true;
    return !address.is_ipv4() &&
           std::memcmp(row.ucLocalAddr, address.ipv6().data(), kAny.size()) == 0;
  }
}

/// Adds the users in the table's rows for the address. False if the system hides one.
template <class Table, class Get>
bool add_users(std::vector<std::uint32_t>& users, const SocketAddress& address, Get get) {
  const auto bytes = table_of(get);
  if (!bytes) return false;
  if (bytes->size() < sizeof(DWORD)) return true;
  const auto& table = *reinterpret_cast<const Table*>(bytes->data());
  for (DWORD i = 0; i < table.dwNumEntries; ++i) {
    if (!is_at(table.table[i], address)) continue;
    const auto user = user_of(table.table[i].dwOwningPid);
    if (!user) return false;
    users.push_back(*user);
  }
  return true;
}

template <class Table>
bool add_tcp_users(std::vector<std::uint32_t>& users, const SocketAddress& address, ULONG family) {
  return add_users<Table>(users, address, [&](void* to, DWORD* size) {
    return GetExtendedTcpTable(to, size, FALSE, family, TCP_TABLE_OWNER_PID_LISTENER, 0);
  });
}
template <class Table>
bool add_udp_users(std::vector<std::uint32_t>& users, const SocketAddress& address, ULONG family) {
  return add_users<Table>(users, address, [&](void* to, DWORD* size) {
    return GetExtendedUdpTable(to, size, FALSE, family, UDP_TABLE_OWNER_PID, 0);
  });
}

}  // namespace

std::optional<std::vector<std::uint32_t>> users_at(const SocketAddress& address) {
  std::vector<std::uint32_t> users;
  if (!add_tcp_users<MIB_TCPTABLE_OWNER_PID>(users, address, AF_INET) ||
      !add_udp_users<MIB_UDPTABLE_OWNER_PID>(users, address, AF_INET) ||
      !add_tcp_users<MIB_TCP6TABLE_OWNER_PID>(users, address, AF_INET6) ||
      !add_udp_users<MIB_UDP6TABLE_OWNER_PID>(users, address, AF_INET6)) {
    return std::nullopt;
  }
  std::ranges::sort(users);
  users.erase(std::unique(users.begin(), users.end()), users.end());
  return users;
}

}  // namespace rtpm::transport
