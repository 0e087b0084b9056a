// Before windows.h, which has an older version of it.
#include <winsock2.h>

#include <windows.h>

#include <iphlpapi.h>

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "rtpm/base/utf8_path.hpp"
#include "rtpm/rt/network_survey.hpp"

namespace rtpm::rt {
namespace {

/// The table that `get` writes into a buffer of enough size; empty if the system refuses.
template <class Get>
std::vector<std::byte> table_of(Get get) {
  std::vector<std::byte> table;
  DWORD size = 0;
  DWORD status = get(nullptr, &size);
  constexpr int kTryCount = 8;  // The table may grow meanwhile.
  for (int i = 0; i < kTryCount && status == ERROR_INSUFFICIENT_BUFFER; ++i) {
    table.resize(size);
    status = get(table.data(), &size);
  }
  if (status != NO_ERROR) table.clear();
  return table;
}

/// The id of the process in the table's row for `port`; nullopt if there is no such row.
template <class Table>
std::optional<DWORD> owner_in(const std::vector<std::byte>& bytes, std::uint16_t port) {
  if (bytes.size() < sizeof(Table)) return std::nullopt;
  const auto& table = *reinterpret_cast<const Table*>(bytes.data());
  for (DWORD i = 0; i < table.dwNumEntries; ++i) {
    const auto& row = table.table[i];
    if (ntohs(static_cast<u_short>(row.dwLocalPort)) == port) return row.dwOwningPid;
  }
  return std::nullopt;
}

template <class Table>
std::optional<DWORD> tcp_owner(ULONG family, std::uint16_t port) {
  return owner_in<Table>(table_of([&](void* to, DWORD* size) {
                           return GetExtendedTcpTable(to, size, FALSE, family,
                                                      TCP_TABLE_OWNER_PID_LISTENER, 0);
                         }),
                         port);
}

template <class Table>
std::optional<DWORD> udp_owner(ULONG family, std::uint16_t port) {
  return owner_in<Table>(table_of([&](void* to, DWORD* size) {
                           return GetExtendedUdpTable(to, size, FALSE, family, UDP_TABLE_OWNER_PID,
                                                      0);
                         }),
                         port);
}

/// Empty if this user may not see it.
std::string program_of(DWORD process_id) {
  const HANDLE process = OpenProcess(PROCESS_QUERY_LIMITED_INFORMATION, FALSE, process_id);
  if (process == nullptr) return {};
  std::array<wchar_t, 1024> path{};
  DWORD size = static_cast<DWORD>(path.size());
  const bool is_known = QueryFullProcessImageNameW(process, 0, path.data(), &size) != 0;
  CloseHandle(process);
  return is_known ? utf8_of(std::filesystem::path(path.data()).filename()) : std::string();
}

}  // namespace

// The interfaces and routes are left to the trial.
MulticastFacts read_multicast(const std::string&, const std::string& group) {
  return {.group = group, .interfaces = {}, .route = {}, .reason = {}};
}

std::optional<PortHolder> holder_of_port(const std::string&, std::uint16_t port) {
  auto owner = udp_owner<MIB_UDPTABLE_OWNER_PID>(AF_INET, port);
  if (!owner) owner = udp_owner<MIB_UDP6TABLE_OWNER_PID>(AF_INET6, port);
  PortHolder holder{.transport = owner ? "UDP" : "TCP"};
  if (!owner) owner = tcp_owner<MIB_TCPTABLE_OWNER_PID>(AF_INET, port);
  if (!owner) owner = tcp_owner<MIB_TCP6TABLE_OWNER_PID>(AF_INET6, port);
  if (!owner) return std::nullopt;
  holder.program = program_of(*owner);
  if (!holder.program.empty()) holder.process_id = static_cast<int>(*owner);
  return holder;
}

}  // namespace rtpm::rt
