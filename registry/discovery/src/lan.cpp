#include "lan.hpp"

#include <mutex>
#include <set>

#include "rtpm/discovery/datagram.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::discovery {

std::string group_of(std::uint8_t domain) {
  return "239.255.43." + std::to_string(domain);
}

void say_once(const std::string& sentence) {
  static std::mutex mutex;
  static std::set<std::string> said;
  const std::lock_guard lock(mutex);
  // The set stays small: a program has few interfaces and notes.
  if (said.size() < 256 && said.insert(sentence).second) rt::print_error("discovery", sentence);
}

expected<std::vector<transport::NetworkInterface>, SetupError> interfaces_of(const Scope& scope) {
  auto interfaces = transport::multicast_interfaces(scope.interface);
  if (!interfaces) return interfaces;
  std::string names;
  for (const transport::NetworkInterface& interface : *interfaces)
    names += (names.empty() ? "" : ", ") + interface.name + " (" + interface.address + ")";
  say_once("domain " + std::to_string(scope.domain) + " on " + names + ", group " +
           group_of(scope.domain) + ":" + std::to_string(kPort));
  return interfaces;
}

}  // namespace rtpm::discovery
