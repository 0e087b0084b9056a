#include <algorithm>
#include <cstring>
#include <span>
#include <utility>

#include "os/native_socket.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/transport/address.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport {
namespace {

using Addresses = std::vector<InterfaceAddress>;

// The entry of this host's address, or one without an interface: the address may appear later, or
// be refused.
InterfaceAddress entry_of(const SocketAddress& address, const Addresses& own) {
  const auto found = std::ranges::find_if(
      own, [&](const InterfaceAddress& each) { return each.address.is_same_host(address); });
  return found != own.end() ? *found : InterfaceAddress{.address = address};
}

// The addresses of an interface. Link-local ones only if there is no other, as callers on other
// hosts would need to know their own zone for them.
Addresses addresses_of_interface(const std::string& name, const Addresses& own) {
  Addresses found;
  for (const bool is_link_local : {false, true}) {
    for (const InterfaceAddress& each : own) {
      if (each.interface == name && each.address.is_link_local() == is_link_local) {
        found.push_back(each);
      }
    }
    if (!found.empty()) break;
  }
  return found;
}

Addresses loopback_addresses(const Addresses& own) {
  Addresses found;
  for (const char* host : {"127.0.0.1", "::1"}) {
    const auto entry = entry_of(*SocketAddress::parse(host, 0), own);
    if (!entry.interface.empty()) found.push_back(entry);
  }
  return found;
}

// The addresses for one item of the list.
expected<Addresses, SetupError> addresses_for(const std::string& host, const Addresses& own,
                                              MonotonicTime deadline) {
  if (host == "localhost") return loopback_addresses(own);
  if (!SocketAddress::parse(host, 0) && os::zone_of(host) != 0) {
    auto found = addresses_of_interface(host, own);
    if (!found.empty()) return found;
    return setup_error("interface '" + printable(host) + "' has no address, or is down", "",
                       "see `ip address`; --host any also serves what comes later");
  }
  const auto named = addresses_of(host, 0, deadline);
  if (!named) return unexpected{named.error()};
  Addresses found;
  for (const SocketAddress& address : *named) {
    if (address.is_unspecified()) {
      return setup_error("host " + host + " is no address that callers could use", "",
                         "write any to serve every address of this host");
    }
    found.push_back(entry_of(address, own));
  }
  return found;
}

}  // namespace

bool is_in_network_of(const InterfaceAddress& own, const SocketAddress& address) noexcept {
  if (own.address.family() != address.family() || own.prefix_size == 0) return false;
  const auto mine = own.address.bytes();
  const auto its = address.bytes();
  const auto whole_count = static_cast<std::size_t>(own.prefix_size / 8);
  if (whole_count > mine.size() || std::memcmp(mine.data(), its.data(), whole_count) != 0) {
    return false;
  }
  const int rest = own.prefix_size % 8;
  return rest == 0 || mine[whole_count] >> (8 - rest) == its[whole_count] >> (8 - rest);
}

expected<HostsToServe, SetupError> hosts_to_serve(const std::string& hosts,
                                                  MonotonicTime deadline) {
  HostsToServe to_serve;
  const Addresses own = own_addresses();
  for (std::size_t begin = 0; begin <= hosts.size();) {
    const std::size_t end = std::min(hosts.find(',', begin), hosts.size());
    const std::string host = hosts.substr(begin, end - begin);
    begin = end + 1;
    if (host == "any") {
      to_serve.is_any = true;
      continue;
    }
    auto found = addresses_for(host, own, deadline);
    if (!found) return unexpected{std::move(found.error())};
    for (InterfaceAddress& each : *found) {
      const bool is_there = std::ranges::any_of(
          to_serve.addresses, [&](const auto& other) { return other.address == each.address; });
      if (!is_there) to_serve.addresses.push_back(std::move(each));
    }
  }
  if (to_serve.is_any) to_serve.addresses = own;
  if (!to_serve.is_any && to_serve.addresses.size() > kServedAddressCountMax) {
    return setup_error("host '" + printable(hosts) + "' stands for " +
                           std::to_string(to_serve.addresses.size()) + " addresses",
                       "", "name at most " + std::to_string(kServedAddressCountMax) + ", or any");
  }
  if (!to_serve.is_any && to_serve.addresses.empty()) {
    return setup_error("host '" + printable(hosts) + "' has no address", "", "see `ip address`");
  }
  return to_serve;
}

}  // namespace rtpm::transport
