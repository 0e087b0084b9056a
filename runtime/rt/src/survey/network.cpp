#include <algorithm>
#include <string>
#include <vector>

#include "rtpm/rt/network_survey.hpp"
#include "survey/host_tree.hpp"

namespace rtpm::rt {
namespace {

/// The address "239.255.42.1" in the byte order of /proc/net/route: the first number lowest.
std::uint32_t address_of(const std::string& text) {
  std::uint32_t address = 0;
  int shift = 0;
  std::string rest = text + ".";
  for (std::size_t dot = rest.find('.'); dot != std::string::npos && shift < 32;
       dot = rest.find('.'), shift += 8) {
    const auto part = number_of(std::string_view(rest).substr(0, dot)).value_or(0) & 0xff;
    address |= static_cast<std::uint32_t>(part) << shift;
    rest.erase(0, dot + 1);
  }
  return address;
}

InterfaceFacts interface_of(const HostTree& tree, const std::string& name) {
  constexpr std::int64_t kUp = 0x1;  // See netdevice(7).
  constexpr std::int64_t kLoopback = 0x8;
  constexpr std::int64_t kMulticast = 0x1000;
  std::string text = tree.text("/sys/class/net/" + name + "/flags");
  if (text.starts_with("0x")) text.erase(0, 2);
  const std::int64_t flags = number_of(text, 16).value_or(0);
  return {name, (flags & kUp) != 0, (flags & kLoopback) != 0, (flags & kMulticast) != 0};
}

/// The interface of the most specific route.
std::string route_of(const HostTree& tree, std::uint32_t address) {
  std::string best;
  std::int64_t best_mask_bits = -1;
  const std::vector<std::string> lines = lines_of(tree.text("/proc/net/route"));
  for (std::size_t i = 1; i < lines.size(); ++i) {
    const std::vector<std::string> words = words_of(lines[i]);
    if (words.size() < 8) continue;
    const auto destination = number_of(words[1], 16);
    const auto flags = number_of(words[3], 16);
    const auto mask = number_of(words[7], 16);
    if (!destination || !mask || (flags.value_or(0) & 1) == 0) continue;  // Not up.
    if ((address & static_cast<std::uint32_t>(*mask)) != static_cast<std::uint32_t>(*destination)) {
      continue;
    }
    const int bits = __builtin_popcountll(static_cast<unsigned long long>(*mask));
    if (bits <= best_mask_bits) continue;
    best_mask_bits = bits;
    best = words[0];
  }
  return best;
}

/// The inode of the socket that listens at `port`, from a table of /proc/net; 0 if there is none.
std::int64_t listener_in(const HostTree& tree, const std::string& table, std::uint16_t port,
                         std::string_view state) {
  const std::vector<std::string> lines = lines_of(tree.text("/proc/net/" + table));
  for (std::size_t i = 1; i < lines.size(); ++i) {
    // "0: 0100007F:1CFC 00000000:0000 0A 00000000:00000000 00:00000000 00000000 0 0 4711 …"
    const std::vector<std::string> words = words_of(lines[i]);
    if (words.size() < 10 || words[3] != state) continue;
    const std::string_view local = words[1];
    if (number_of(local.substr(local.find(':') + 1), 16) != port) continue;
    const std::int64_t inode = number_of(words[9]).value_or(0);
    if (inode > 0) return inode;
  }
  return 0;
}

void name_holder(const HostTree& tree, std::int64_t inode, PortHolder& holder) {
  const std::string wanted = "socket:[" + std::to_string(inode) + "]";
  for (const int id : tree.process_ids()) {
    const std::string folder = "/proc/" + std::to_string(id);
    for (const std::string& descriptor : tree.entries(folder + "/fd")) {
      if (tree.link(folder + "/fd/" + descriptor) != wanted) continue;
      holder.process_id = id;
      holder.program = tree.text(folder + "/comm");
      return;
    }
  }
}

std::string names_of(const std::vector<InterfaceFacts>& interfaces) {
  std::string names;
  for (const InterfaceFacts& facts : interfaces) {
    if (facts.is_up && !facts.is_loopback) names += (names.empty() ? "" : ", ") + facts.name;
  }
  return names;
}

constexpr const char* kMulticastCost =
    "hubs can't send events to many consumers at once (rtpm-eventd --multicast): each consumer "
    "takes a stream of its own; calls and all else are not affected";

Finding lacking_multicast(std::string text, std::string remedy) {
  return {"multicast", Severity::kNote, std::move(text), kMulticastCost, std::move(remedy)};
}

}  // namespace

MulticastFacts read_multicast(const std::string& root, const std::string& group) {
  const HostTree tree(root);
  MulticastFacts facts{.group = group};
  for (const std::string& name : tree.entries("/sys/class/net"))
    facts.interfaces.push_back(interface_of(tree, name));
  facts.route = route_of(tree, address_of(group));
  return facts;
}

std::optional<PortHolder> holder_of_port(const std::string& root, std::uint16_t port) {
  const HostTree tree(root);
  struct Table {
    const char* name;
    const char* transport;
    const char* state;  // The kernel's code: 7 for a UDP socket without a peer, 10 for a listener.
  };
  for (const Table& table : {Table{"udp", "UDP", "07"}, Table{"udp6", "UDP", "07"},
                             Table{"tcp", "TCP", "0A"}, Table{"tcp6", "TCP", "0A"}}) {
    const std::int64_t inode = listener_in(tree, table.name, port, table.state);
    if (inode == 0) continue;
    PortHolder holder{.transport = table.transport};
    name_holder(tree, inode, holder);
    return holder;
  }
  return std::nullopt;
}

Finding judge_multicast(const MulticastFacts& facts) {
  const auto is_ready_loopback = [](const InterfaceFacts& each) {
    return each.is_loopback && each.is_up;
  };
  const bool is_refused = facts.trial == MulticastTrial::kRefused;
  if (is_refused && std::ranges::none_of(facts.interfaces, is_ready_loopback)) {
    return lacking_multicast(facts.reason, "sudo ip link set dev lo up");
  }
  const auto route = std::ranges::find(facts.interfaces, facts.route, &InterfaceFacts::name);
  if (facts.route.empty() || route == facts.interfaces.end()) {
    const std::string names = names_of(facts.interfaces);
    const std::string first = names.empty() ? "lo" : names.substr(0, names.find(','));
    return lacking_multicast("no route leads to " + facts.group,
                             "sudo ip route add 239.0.0.0/8 dev " + first);
  }
  if (!route->has_multicast) {
    return lacking_multicast(
        "the interface for " + facts.group + ", " + route->name + ", has multicast switched off",
        "sudo ip link set dev " + route->name + " multicast on");
  }
  if (!route->is_up) {
    return lacking_multicast("the interface for " + facts.group + ", " + route->name + ", is down",
                             "sudo ip link set dev " + route->name + " up");
  }
  if (is_refused) {
    return lacking_multicast(facts.reason, "see which system calls are allowed here");
  }
  if (facts.trial != MulticastTrial::kReceived) {
    return lacking_multicast(
        facts.trial == MulticastTrial::kNotSent
            ? "a datagram to " + facts.group + " can't be sent"
            : "a datagram to " + facts.group + " did not come back within 0.5 s",
        "look for a rule that drops it: sudo nft list ruleset");
  }
  return {"multicast", Severity::kGood,
          "a datagram to " + facts.group + " comes back; it goes by " + route->name};
}

Finding judge_port(const PortFacts& facts) {
  const std::string port = std::to_string(facts.port);
  Finding finding{.id = "port-" + port};
  if (facts.answers) {
    finding.text = "a server of RTPM has it, " + facts.program + "'s default";
    return finding;
  }
  if (!facts.holder) {
    finding.text = "it is free for " + facts.program;
    return finding;
  }
  const bool is_known = facts.holder->process_id != 0;
  finding.severity = Severity::kWarning;
  finding.text = (is_known ? "'" + facts.holder->program + "' (process " +
                                 std::to_string(facts.holder->process_id) + ")"
                           : std::string("a program of another user")) +
                 " has it by " + facts.holder->transport + " and does not answer as RTPM does";
  finding.cost = facts.program + " does not start there, and programs do not find it by default";
  finding.remedy = (is_known ? "kill " + std::to_string(facts.holder->process_id) + ", or "
                             : "sudo ss -lnptu 'sport = :" + port + "' shows it; or ") +
                   facts.program + " " + facts.option + " " + std::to_string(facts.port + 1000);
  return finding;
}

}  // namespace rtpm::rt
