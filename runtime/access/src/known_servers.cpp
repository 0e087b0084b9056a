#include "rtpm/access/known_servers.hpp"

#include <algorithm>

#include "rtpm/access/fingerprint.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/base/whole_number.hpp"
#include "rtpm/crypto/key_text.hpp"
#include "words.hpp"

namespace rtpm::access {
namespace {

constexpr std::size_t kHostSizeMax = 253;  // The limit for names in the DNS.

/// Parses "host", "host:port", "[address]" or "[address]:port".
bool read_place(std::string_view text, KnownServer& server) {
  std::string_view port;
  if (text.starts_with('[')) {
    const std::size_t end = text.find(']');
    if (end == std::string_view::npos) return false;
    server.host = text.substr(1, end - 1);
    port = text.substr(end + 1);
  } else {
    const std::size_t colon = std::min(text.find(':'), text.size());
    server.host = text.substr(0, colon);
    port = text.substr(colon);
  }
  if (server.host.empty() || server.host.size() > kHostSizeMax) return false;
  if (port.empty()) return true;
  server.port = whole_number_of<std::uint16_t>(port.substr(1)).value_or(0);
  return port.front() == ':' && server.port != 0;
}

/// Parses a line; returns its fault, or nullopt if it is valid.
std::optional<LineFault> read_line(std::string_view line, KnownServer& server) {
  const std::vector<Word> words = words_of(line);
  const auto fault = [&](std::size_t word, std::string why) {
    const std::size_t column = word < words.size() ? words[word].column : line.size() + 1;
    return LineFault{server.line, column, std::move(why)};
  };
  if (line.size() > kGrantLineSizeMax) return fault(0, "the line is too long");
  if (!read_place(words[0].text, server))
    return fault(0, "'" + printable(words[0].text, 64) +
                        "' is no server; write HOST, HOST:PORT or [IPV6]:PORT");
  if (words.size() < 2 || words[1].text != crypto::kKeyTextName)
    return fault(1, "rtpm25519 and a key follow the server");
  if (words.size() < 3 || !crypto::decode_key(words[2].text, server.key))
    return fault(2, "a public key has 44 characters of Base64; `rtpm key show` prints one");
  if (words.size() > 3 && !words[3].text.starts_with('#'))
    return fault(3, "nothing but a comment, which begins with #, follows the key");
  return std::nullopt;
}

/// Whether the words are "local uid:1001"; no server's line begins with these two words.
bool is_local(const std::vector<Word>& words) {
  return words.size() >= 2 && words[0].text == "local" && words[1].text.starts_with("uid:");
}

/// Parses an is_local() line; returns its fault, or nullopt if it is valid.
std::optional<LineFault> read_local(const std::vector<Word>& words, std::size_t line,
                                    std::uint32_t& user) {
  const auto number = whole_number_of<std::uint32_t>(words[1].text.substr(4));
  user = number.value_or(kUnknownUser);
  if (user == kUnknownUser)
    return LineFault{line, words[1].column,
                     "'" + printable(words[1].text, 64) + "' is no user's number, as uid:1001"};
  if (words.size() > 2 && !words[2].text.starts_with('#'))
    return LineFault{line, words[2].column,
                     "nothing but a comment, which begins with #, follows the user"};
  return std::nullopt;
}

}  // namespace

KnownServers parse_known_servers(std::string_view text) {
  KnownServers result;
  visit_lines(text, [&](std::string_view line, std::size_t number) {
    KnownServer server;
    server.line = number;
    std::uint32_t user = 0;
    const std::vector<Word> words = words_of(line);
    const bool names_user = line.size() <= kGrantLineSizeMax && is_local(words);
    auto fault = names_user ? read_local(words, number, user) : read_line(line, server);
    if (!fault && result.servers.size() + result.local_users.size() == kGrantCountMax)
      fault =
          LineFault{number, 1, "a file has at most " + std::to_string(kGrantCountMax) + " servers"};
    if (!fault && names_user) {
      result.local_users.push_back(user);
    } else if (!fault) {
      result.servers.push_back(std::move(server));
    } else if (++result.fault_count <= kFaultCountMax) {
      result.faults.push_back(std::move(*fault));
    }
  });
  return result;
}

std::vector<KnownServer> KnownServers::find(std::string_view host, std::uint16_t port) const {
  std::vector<KnownServer> found;
  for (const std::uint16_t wanted : {port, std::uint16_t{0}}) {
    for (const KnownServer& server : servers) {
      if (server.host == host && server.port == wanted) found.push_back(server);
    }
  }
  return found;
}

std::string to_line(const KnownServer& server) {
  const bool is_ipv6 = server.host.find(':') != std::string::npos;
  std::string line = is_ipv6 ? '[' + server.host + ']' : server.host;
  if (server.port != 0) line += ':' + std::to_string(server.port);
  return line + ' ' + public_key_text(server.key);
}

}  // namespace rtpm::access
