#include "host/discovery.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "rtpm/base/printable.hpp"
#include "rtpm/discovery/datagram.hpp"
#include "rtpm/discovery/finder.hpp"
#include "rtpm/discovery/scope.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/transport/lan_socket.hpp"
#include "rtpm/transport/socket_folder.hpp"

namespace rtpm::tool {
namespace {

using rt::Finding;
using rt::Severity;

constexpr Duration kInterfacePatience = std::chrono::milliseconds{300};

std::string counted(std::size_t count, const std::string& thing) {
  return std::to_string(count) + " " + thing + (count == 1 ? "" : "s");
}

Finding survey_discovery_folder() {
  const std::string folder = transport::runtime_folder();
  const auto content = transport::read_socket_folder(folder);
  if (!content) {
    return {"discovery-folder", Severity::kProblem,
            printable(content.error().reason(), kShownWhole),
            "programs of this host find each other only by URLs, and serve no names themselves",
            content.error().remedy};
  }
  std::string text = "programs of this host find each other in " + printable(folder) + " (mode " +
                     "0700): " + counted(content->names.size(), "name service");
  if (content->stale_count > 0) {
    text += ", " + counted(content->stale_count, "stale socket") + " removed";
  }
  if (content->foreign_count > 0) {
    text += ", " + counted(content->foreign_count, "other file");
  }
  return {"discovery-folder", Severity::kGood, std::move(text)};
}

/// Whether a datagram sent to the group returns to this host through the interface.
bool passes_multicast(const transport::NetworkInterface& interface) {
  // A domain's group with another port, so no program receives the datagram.
  constexpr const char* kGroup = "239.255.43.255";
  const auto port = static_cast<std::uint16_t>(0xc000U | (rt::random_u64() & 0x3fffU));
  auto receiver = transport::LanSocket::join(kGroup, port, {interface});
  auto sender = transport::LanSocket::open(interface.address);
  if (!receiver || !sender) return false;
  const std::array<std::byte, 8> sent{};
  if (!sender->send(sent, {transport::parse_address(kGroup), port})) return false;
  std::vector<transport::LanSocket> sockets;
  sockets.push_back(std::move(*receiver));
  transport::wait_for_any(sockets, rt::now() + kInterfacePatience);
  std::array<std::byte, 8> buffer{};
  transport::LanPeer from;
  return sockets.front().receive(buffer, from).size() == sent.size();
}

void survey_interfaces(const discovery::Scope& scope, std::vector<Finding>& findings) {
  const auto interfaces = transport::multicast_interfaces(scope.interface);
  if (!interfaces) return;  // find_services() reports the error.
  for (const transport::NetworkInterface& interface : *interfaces) {
    const std::string name = interface.name + " (" + interface.address + ")";
    if (passes_multicast(interface)) {
      findings.push_back({"discovery-multicast", Severity::kGood, name + " sends multicast"});
    } else {
      findings.push_back({"discovery-multicast", Severity::kProblem,
                          "no multicast goes out through " + name,
                          "no server of the LAN is found by it",
                          "let the firewall pass UDP to 239.255.43.0/24, or name the hosts: "
                          "--discover HOST,HOST"});
    }
  }
}

Finding judge_found(const discovery::Scope& scope, const std::string& where,
                    const discovery::FoundServices& found) {
  std::size_t local_count = 0;
  std::size_t registry_count = 0;
  std::size_t lan_count = 0;
  for (const discovery::FoundService& service : found.services) {
    if (service.is_guess) continue;
    (service.is_of_this_host ? local_count : lan_count) += 1;
    registry_count += service.is_registry ? 1 : 0;
  }
  std::string text = "discovery (" + printable(where) + ") finds " +
                     counted(local_count, "name service") + " on this host";
  if (scope.is_of_lan()) text += " and " + std::to_string(lan_count) + " on the LAN";
  text += ", " + std::to_string(registry_count) + " of them registries";
  for (const std::string& note : found.notes)
    text += "; " + printable(note, kShownWhole);
  if (!scope.is_of_lan() || lan_count > 0) {
    return {"discovery", found.notes.empty() ? Severity::kGood : Severity::kWarning, text};
  }
  return {"discovery", Severity::kWarning, text, "only programs of this host are found by name",
          "start servers there with --host ADDRESS and the same domain; where multicast is "
          "blocked, name the hosts: --discover HOST,HOST"};
}

}  // namespace

std::vector<Finding> survey_discovery(Context& context) {
  const auto scope = discovery::parse_scope(context.registry);
  std::vector<Finding> findings{survey_discovery_folder()};
  if (!scope) {
    findings.push_back({"discovery", Severity::kProblem,
                        printable(scope.error().reason(), kShownWhole), "no name is found",
                        scope.error().remedy});
    return findings;
  }
  if (scope->is_url()) return findings;
  if (scope->kind == discovery::Scope::Kind::kLan) survey_interfaces(*scope, findings);
  const auto found = discovery::find_services(*scope);
  if (found) {
    findings.push_back(judge_found(*scope, context.registry, *found));
  } else if (findings.front().severity == Severity::kGood) {
    findings.push_back({"discovery", Severity::kProblem,
                        printable(found.error().reason(), kShownWhole), "no name is found",
                        found.error().remedy});
  }
  return findings;
}

}  // namespace rtpm::tool
