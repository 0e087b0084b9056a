#include "rtpm/discovery/scope.hpp"

#include <algorithm>
#include <optional>

#include "rtpm/base/whole_number.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::discovery {
namespace {

unexpected<SetupError> no_scope(std::string_view text, const std::string& why) {
  return setup_error("'" + std::string(text) + "' is no URL of a registry and no way to find one",
                     why,
                     "give --registry rtpm://host:port/path, or --discover host, "
                     "lan[:DOMAIN]@INTERFACE such as lan:7@eth0, or hosts such as "
                     "10.0.0.5,labpc:7420");
}

expected<Scope, SetupError> lan_of(std::string_view text) {
  Scope scope{.kind = Scope::Kind::kLan};
  const std::size_t at = text.find('@');
  if (at == std::string_view::npos || at + 1 == text.size()) {
    return no_scope(text, "the interface is missing; '@any' takes all");
  }
  scope.interface = text.substr(at + 1);
  // The part after "lan".
  std::string_view domain = text.substr(3, at - 3);
  if (domain.empty()) return scope;
  domain.remove_prefix(1);
  const auto number = whole_number_of<std::uint8_t>(domain);
  if (!number) return no_scope(text, "a domain is a number from 0 to 255");
  scope.domain = *number;
  return scope;
}

/// A host and port are valid if they form a valid URL.
std::optional<ListedHost> listed_host_of(std::string_view text) {
  ListedHost listed{std::string(text)};
  if (const std::size_t colon = text.find(':'); colon != std::string_view::npos) {
    const auto port = whole_number_of<std::uint16_t>(text.substr(colon + 1));
    if (!port || *port == 0) return std::nullopt;
    listed = {std::string(text.substr(0, colon)), *port};
  }
  return wire::parse_url("rtpm://" + listed.host + ":1/x") ? std::optional(listed) : std::nullopt;
}

}  // namespace

expected<Scope, SetupError> parse_scope(std::string_view text) {
  if (wire::is_url(text)) return Scope{.kind = Scope::Kind::kUrl, .url = std::string(text)};
  if (text == kThisHost) return Scope{};
  if (text.empty()) return no_scope(text, "");
  if (text == "lan" || text.starts_with("lan:") || text.starts_with("lan@")) return lan_of(text);
  Scope scope{.kind = Scope::Kind::kHosts};
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t comma = std::min(text.find(',', begin), text.size());
    const std::string_view host = text.substr(begin, comma - begin);
    const auto listed = listed_host_of(host);
    if (!listed) return no_scope(text, "'" + std::string(host) + "' is no host");
    scope.hosts.push_back(*listed);
    if (scope.hosts.size() > kListedHostCountMax) {
      return no_scope(text, "at most " + std::to_string(kListedHostCountMax) + " hosts fit a list");
    }
    begin = comma + 1;
  }
  return scope;
}

}  // namespace rtpm::discovery
