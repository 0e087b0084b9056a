#include <algorithm>
#include <bit>
#include <string>
#include <vector>

#include "rtpm/rt/network_survey.hpp"
#include "survey/host_tree.hpp"

// The facts about the network in the system's files.
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
    const int bits = std::popcount(static_cast<std::uint64_t>(*mask));
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

}  // namespace rtpm::rt
