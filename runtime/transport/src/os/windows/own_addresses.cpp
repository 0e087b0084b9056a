// Winsock's header first, see bsd_sockets.hpp.
#include "bsd_sockets.hpp"
// Behind it.
#include <iphlpapi.h>
#undef interface

#include <cstddef>
#include <vector>

#include "os/native_socket.hpp"
#include "rtpm/base/whole_number.hpp"
#include "rtpm/transport/address.hpp"

namespace rtpm::transport {
namespace {

/// The list of adapters, in memory of its own.
class Adapters {
 public:
  Adapters() {
    constexpr ULONG kFlags =
        GAA_FLAG_SKIP_ANYCAST | GAA_FLAG_SKIP_MULTICAST | GAA_FLAG_SKIP_DNS_SERVER;
    ULONG size = 16 * 1024;
    // It may grow between two calls.
    for (int attempt = 0; attempt < 4; ++attempt) {
      memory_.resize(size / sizeof(std::max_align_t) + 1);
      const ULONG error = GetAdaptersAddresses(AF_UNSPEC, kFlags, nullptr, first(), &size);
      if (error == NO_ERROR) {
        is_filled_ = true;
        return;
      }
      if (error != ERROR_BUFFER_OVERFLOW) return;
    }
  }
  [[nodiscard]] const IP_ADAPTER_ADDRESSES* begin() noexcept {
    return is_filled_ ? first() : nullptr;
  }

 private:
  [[nodiscard]] IP_ADAPTER_ADDRESSES* first() noexcept {
    return reinterpret_cast<IP_ADAPTER_ADDRESSES*>(memory_.data());
  }
  std::vector<std::max_align_t> memory_{};
  bool is_filled_ = false;
};

/// "Ethernet 2", as Windows shows it.
std::string name_of(const IP_ADAPTER_ADDRESSES& adapter) {
  const wchar_t* const wide = adapter.FriendlyName;
  const int size = WideCharToMultiByte(CP_UTF8, 0, wide, -1, nullptr, 0, nullptr, nullptr);
  if (size <= 1) return {};
  std::string name(static_cast<std::size_t>(size), '\0');
  WideCharToMultiByte(CP_UTF8, 0, wide, -1, name.data(), size, nullptr, nullptr);
  name.pop_back();  // The zero at its end.
  return name;
}

}  // namespace

std::vector<InterfaceAddress> own_addresses() {
  std::vector<InterfaceAddress> found;
  Adapters adapters;
  for (const auto* adapter = adapters.begin(); adapter != nullptr; adapter = adapter->Next) {
    if (adapter->OperStatus != IfOperStatusUp) continue;
    const bool has_multicast = adapter->IfType != IF_TYPE_SOFTWARE_LOOPBACK &&
                               (adapter->Flags & IP_ADAPTER_NO_MULTICAST) == 0;
    const std::string name = name_of(*adapter);
    for (const auto* each = adapter->FirstUnicastAddress; each != nullptr; each = each->Next) {
      const auto& address = each->Address;
      found.push_back(
          {name,
           SocketAddress::of(address.lpSockaddr, static_cast<std::size_t>(address.iSockaddrLength)),
           each->OnLinkPrefixLength, has_multicast});
    }
  }
  return found;
}

namespace os {

// "12" as well, because names have blanks.
std::uint32_t zone_of(const std::string& name) {
  if (const auto number = whole_number_of<std::uint32_t>(name)) return *number;
  Adapters adapters;
  for (const auto* adapter = adapters.begin(); adapter != nullptr; adapter = adapter->Next) {
    if (name_of(*adapter) != name) continue;
    return adapter->Ipv6IfIndex != 0 ? adapter->Ipv6IfIndex : adapter->IfIndex;
  }
  return 0;
}

}  // namespace os
}  // namespace rtpm::transport
