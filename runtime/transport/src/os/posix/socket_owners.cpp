#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <string_view>

#include "proc_net.hpp"
#include "rtpm/base/whole_number.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport {
namespace {

/// The kernel's codes for socket states: an unconnected UDP socket, and a listening TCP socket.
constexpr std::string_view kUnconnected = "07";
constexpr std::string_view kListening = "0A";

std::optional<std::uint32_t> hexadecimal(std::string_view text) noexcept {
  std::uint32_t number = 0;
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, number, 16);
  return read.ec == std::errc{} && read.ptr == end ? std::optional(number) : std::nullopt;
}

/// Parses "0100007F:1CFC", or 32 digits and a port: each group of 8 is a number of the address's
/// bytes, in native byte order.
std::optional<SocketAddress> address_of(std::string_view text) {
  const std::size_t colon = text.find(':');
  if (colon != 8 && colon != 32) return std::nullopt;
  const auto port = hexadecimal(text.substr(colon + 1));
  std::array<std::uint32_t, 4> groups{};
  for (std::size_t i = 0; i < colon / 8; ++i) {
    const auto group = hexadecimal(text.substr(8 * i, 8));
    if (!group) return std::nullopt;
    groups[i] = *group;
  }
  if (!port || *port > 0xffff) return std::nullopt;
  const auto number = static_cast<std::uint16_t>(*port);
  if (colon == 8) return SocketAddress::of_ipv4(ntohl(groups[0]), number);
  SocketAddress::Ipv6 address{};
  std::memcpy(address.data(), groups.data(), sizeof address);
  // An IPv4 address mapped into IPv6 becomes IPv4.
  return SocketAddress::of(SocketAddress::of_ipv6(address, 0, number).peer());
}

/// "::" counts as accepting IPv4, too, as the setting is not visible from outside.
bool is_at(const SocketAddress& socket, const SocketAddress& address) noexcept {
  if (socket.port() != address.port()) return false;
  if (socket.is_unspecified()) return !socket.is_ipv4() || address.is_ipv4();
  return socket.is_same_host(address);
}

}  // namespace

std::vector<std::uint32_t> users_in_table(std::istream& table, bool is_tcp,
                                          const SocketAddress& address) {
  std::vector<std::uint32_t> users;
  std::string line;
  std::getline(table, line);  // The column titles.
  while (std::getline(table, line)) {
    std::istringstream text(line);
    const std::vector<std::string> words{std::istream_iterator<std::string>(text), {}};
    if (words.size() < 8) continue;
    // Listening sockets come first, and connections may be many.
    if (is_tcp && words[3] != kListening) break;
    if (!is_tcp && words[3] != kUnconnected) continue;
    const auto socket = address_of(words[1]);
    const auto user = whole_number_of<std::uint32_t>(words[7]);
    if (socket && user && is_at(*socket, address)) users.push_back(*user);
  }
  return users;
}

std::optional<std::vector<std::uint32_t>> users_at(const SocketAddress& address) {
  std::vector<std::uint32_t> users;
  for (const char* name : {"tcp", "tcp6", "udp", "udp6"}) {
    // This thread's network: /proc/net is that of the process's first thread.
    std::ifstream file(std::string("/proc/thread-self/net/") + name);
    const bool is_of_ipv6 = name[3] == '6';
    // Without IPv6 in the kernel, its tables do not exist.
    if (!file && !is_of_ipv6) return std::nullopt;
    const auto found = users_in_table(file, name[0] == 't', address);
    users.insert(users.end(), found.begin(), found.end());
  }
  std::ranges::sort(users);
  // Avoids std::ranges::unique, because Clang 14 rejects libstdc++'s.
  users.erase(std::unique(users.begin(), users.end()), users.end());
  return users;
}

}  // namespace rtpm::transport
