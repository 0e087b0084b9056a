#include <algorithm>
#include <atomic>
#include <memory>
#include <string>
#include <system_error>
#include <thread>

#include "os/native_socket.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/transport/address.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport {
namespace {

// A name server may take much longer than its caller waits, and the call can't be interrupted.
constexpr int kLookupCountMax = 8;
std::atomic<int> lookup_count{0};

struct Lookup {
  std::string host{};
  int error = EAI_FAIL;
  std::vector<SocketAddress> addresses{};
  rt::Semaphore done{};
};

void look_up(Lookup& lookup) noexcept {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_DGRAM;  // Otherwise each address is returned once per socket type.
  addrinfo* found = nullptr;
  lookup.error = getaddrinfo(lookup.host.c_str(), nullptr, &hints, &found);
  for (const addrinfo* each = found; each != nullptr; each = each->ai_next) {
    const auto address = SocketAddress::of(each->ai_addr, each->ai_addrlen);
    const bool is_new = std::ranges::find(lookup.addresses, address) == lookup.addresses.end();
    if (is_new && lookup.addresses.size() < kAddressCountMax) lookup.addresses.push_back(address);
  }
  if (found != nullptr) freeaddrinfo(found);
  if (lookup.error == 0 && lookup.addresses.empty()) lookup.error = EAI_NONAME;
  lookup.done.post();
}

// Starts a look-up on a detached thread. Null if too many are in progress or no thread is left.
std::shared_ptr<Lookup> begin_lookup(const std::string& host) {
  if (lookup_count.fetch_add(1) >= kLookupCountMax) {
    lookup_count.fetch_sub(1);
    return nullptr;
  }
  auto lookup = std::make_shared<Lookup>();
  lookup->host = host;
  try {
    std::thread([lookup] {
      look_up(*lookup);
      lookup_count.fetch_sub(1);
    }).detach();
  } catch (const std::system_error&) {
    lookup_count.fetch_sub(1);
    return nullptr;
  }
  return lookup;
}

}  // namespace

expected<std::vector<SocketAddress>, SetupError> addresses_of(const std::string& host,
                                                              std::uint16_t port,
                                                              MonotonicTime deadline) {
  const auto not_found = [&host](const std::string& what, const std::string& why) {
    return setup_error("host '" + printable(host) + "' " + what, why,
                       "check the name, or give a numeric address");
  };
  if (const auto numeric = SocketAddress::parse(host, port)) {
    if (!numeric->is_link_local() || numeric->zone() != 0) return std::vector{*numeric};
    return setup_error("host '" + host + "' is link-local, and lacks its zone", "",
                       "add the interface of this host that leads there: " + host + "%eth0");
  }
  // Windows would take it for this host.
  if (host.empty()) return not_found("has no address", "it is empty");
  const auto lookup = begin_lookup(host);
  if (!lookup) {
    return not_found("can't be looked up now",
                     "no thread is left, or too many names are asked for");
  }
  if (!lookup->done.wait_until(deadline)) {
    return not_found("can't be looked up", "no name server answered in time");
  }
  if (lookup->error != 0) return not_found("has no address", os::lookup_error_text(lookup->error));
  for (SocketAddress& address : lookup->addresses)
    address.set_port(port);
  return lookup->addresses;
}

expected<SocketAddress, SetupError> address_of(const std::string& host, std::uint16_t port) {
  const auto addresses = addresses_of(host, port, rt::now() + kResolvePatience);
  if (!addresses) return unexpected{addresses.error()};
  return addresses->front();
}

}  // namespace rtpm::transport
