#include "address.hpp"

#include <algorithm>
#include <cstdint>

#include "rtpm/base/printable.hpp"
#include "rtpm/base/whole_number.hpp"

namespace rtpm::etcd_store {
namespace {

constexpr std::string_view kScheme = "etcd://";
constexpr std::string_view kDefaultPrefix = "rtpm";
constexpr std::size_t kEndpointCountMax = 16;
constexpr std::size_t kPrefixSizeMax = 64;

bool is_letter(char c) noexcept {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
         c == '_' || c == '-';
}

/// "host:port", or "host" if the port is etcd's default.
bool take_endpoint(std::string_view text, std::vector<std::string>& endpoints) {
  const std::size_t colon = text.find(':');
  const std::string_view host = text.substr(0, colon);
  if (host.empty() || host.size() > 253 || !std::ranges::all_of(host, is_letter)) return false;
  std::uint16_t port = 2379;
  if (colon != std::string_view::npos) {
    port = whole_number_of<std::uint16_t>(text.substr(colon + 1)).value_or(0);
    if (port == 0) return false;
  }
  endpoints.push_back(std::string(host) + ':' + std::to_string(port));
  return true;
}

bool is_prefix(std::string_view text) {
  if (text.empty() || text.size() > kPrefixSizeMax || text.front() == '/' || text.back() == '/') {
    return false;
  }
  return std::ranges::all_of(text, [](char c) { return is_letter(c) || c == '/'; });
}

}  // namespace

std::string Address::text() const {
  std::string text(kScheme);
  for (const std::string& endpoint : endpoints)
    text += (text.size() == kScheme.size() ? "" : ",") + endpoint;
  return prefix == kDefaultPrefix ? text : text + '/' + prefix;
}

expected<Address, SetupError> parse_address(std::string_view url) {
  const auto malformed = [&](const char* why) {
    return setup_error("'" + printable(url) + "' is no address of etcd", why,
                       "give etcd://host:2379,host:2379,host:2379, of one cluster");
  };
  if (!url.starts_with(kScheme)) return malformed("it does not begin with etcd://");
  std::string_view rest = url.substr(kScheme.size());
  Address address{{}, std::string(kDefaultPrefix)};
  if (const std::size_t slash = rest.find('/'); slash != std::string_view::npos) {
    if (!is_prefix(rest.substr(slash + 1))) return malformed("what follows '/' is no prefix");
    address.prefix = rest.substr(slash + 1);
    rest = rest.substr(0, slash);
  }
  for (;;) {
    const std::size_t comma = rest.find(',');
    if (!take_endpoint(rest.substr(0, comma), address.endpoints)) {
      return malformed("an endpoint is not host:port");
    }
    if (address.endpoints.size() > kEndpointCountMax) return malformed("it has over 16 endpoints");
    if (comma == std::string_view::npos) return address;
    rest = rest.substr(comma + 1);
  }
}

}  // namespace rtpm::etcd_store
