#include "rtpm/names/reachable.hpp"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::names {
namespace {

enum class Reach : std::uint8_t { kOwn, kSameNetwork, kElsewhere, kLoopback };

Reach reach_of(const std::string& host, std::span<const transport::InterfaceAddress> own) {
  const auto address = transport::SocketAddress::parse(host, 0);
  if (!address) return Reach::kElsewhere;
  if (address->is_loopback()) return Reach::kLoopback;
  const auto is_own = [&](const auto& each) { return each.address.is_same_host(*address); };
  if (std::ranges::any_of(own, is_own)) return Reach::kOwn;
  const auto shares = [&](const auto& each) { return is_in_network_of(each, *address); };
  return std::ranges::any_of(own, shares) ? Reach::kSameNetwork : Reach::kElsewhere;
}

unexpected<SetupError> serves_its_own_host_only(const NameEntry& entry) {
  const std::string host = entry.bound_from.empty() ? "another host" : printable(entry.bound_from);
  return setup_error("'" + printable(entry.name) + "' at " + printable(entry.url) + " on " + host +
                         " serves its own host only",
                     "", "start its server with --host any, or with an address of the network");
}

}  // namespace

expected<std::string, SetupError> reachable_url(const NameEntry& entry,
                                                std::span<const transport::InterfaceAddress> own) {
  auto url = wire::parse_url(entry.url);
  if (!url) return entry.url;
  std::vector<std::pair<Reach, std::string>> hosts;
  for (std::string& host : url->hosts)
    hosts.emplace_back(reach_of(host, own), std::move(host));
  const auto is_loopback = [](const auto& host) { return host.first == Reach::kLoopback; };
  if (entry.is_of_other_host) {
    if (std::ranges::all_of(hosts, is_loopback)) return serves_its_own_host_only(entry);
    std::erase_if(hosts, is_loopback);
    // A host's own addresses are meaningless elsewhere: all hosts with containers use the same
    // ones.
    const auto is_own = [](const auto& host) { return host.first == Reach::kOwn; };
    if (!std::ranges::all_of(hosts, is_own)) std::erase_if(hosts, is_own);
  }
  const auto rank = [](const auto& host) {
    return host.first == Reach::kLoopback ? Reach::kOwn : host.first;
  };
  std::ranges::stable_sort(hosts, {}, rank);
  url->hosts.clear();
  for (auto& [reach, host] : hosts)
    url->hosts.push_back(std::move(host));
  return url->text();
}

expected<std::string, SetupError> reachable_url(const NameEntry& entry) {
  return reachable_url(entry, transport::own_addresses());
}

}  // namespace rtpm::names
