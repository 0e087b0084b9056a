#include "rtpm/wire/url.hpp"

#include <algorithm>
#include <charconv>
#include <utility>

#include "rtpm/wire/limits.hpp"

namespace rtpm::wire {
namespace {

constexpr std::string_view kScheme = "rtpm://";
// RFC 6874: how '%' is written in a URL.
constexpr std::string_view kZoneMark = "%25";
// The longest name of a network interface.
constexpr std::size_t kZoneSizeMax = 15;

bool is_path_character(char c) noexcept {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
         c == '_' || c == '-';
}

bool is_host_character(char c) noexcept {
  return is_path_character(c);
}

bool is_hex_digit(char c) noexcept {
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F');
}

bool is_ipv4_address(std::string_view text) noexcept {
  for (int part = 0; part < 4; ++part) {
    std::uint8_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    const auto size = static_cast<std::size_t>(end - text.data());
    if (error != std::errc{} || (text.front() == '0' && size > 1)) return false;
    text.remove_prefix(size);
    if (part == 3) break;
    if (!text.starts_with('.')) return false;
    text.remove_prefix(1);
  }
  return text.empty();
}

// The number of 16-bit groups between colons; nullopt if one is malformed. An IPv4 address may
// replace the last two.
std::optional<int> count_of_groups(std::string_view text, bool may_end_in_ipv4) noexcept {
  if (text.empty()) return 0;
  for (int count = 1;; ++count) {
    const std::size_t colon = text.find(':');
    const std::string_view group = text.substr(0, colon);
    if (colon == text.npos && may_end_in_ipv4 && is_ipv4_address(group)) return count + 1;
    if (group.empty() || group.size() > 4 || !std::ranges::all_of(group, is_hex_digit)) return {};
    if (colon == text.npos) return count;
    text.remove_prefix(colon + 1);
  }
}

// The host in a part of an authority, without brackets; nullopt if it is malformed.
std::optional<std::string> host_of(std::string_view part) {
  if (!part.starts_with('[')) {
    const bool is_name = !part.empty() && std::ranges::all_of(part, is_host_character);
    return is_name ? std::optional(std::string(part)) : std::nullopt;
  }
  if (!part.ends_with(']')) return std::nullopt;
  part = part.substr(1, part.size() - 2);
  const std::size_t percent = part.find('%');
  std::string host(part.substr(0, percent));
  if (!is_ipv6_address(host)) return std::nullopt;
  if (percent == part.npos) return host;
  std::string_view zone = part.substr(percent);
  if (!zone.starts_with(kZoneMark)) return std::nullopt;
  zone.remove_prefix(kZoneMark.size());
  if (zone.empty() || zone.size() > kZoneSizeMax || !std::ranges::all_of(zone, is_host_character)) {
    return std::nullopt;
  }
  return host.append("%").append(zone);
}

std::optional<std::vector<std::string>> hosts_of(std::string_view list) {
  std::vector<std::string> hosts;
  while (true) {
    const std::size_t comma = list.find(',');
    auto host = host_of(list.substr(0, comma));
    if (!host || hosts.size() == kUrlHostCountMax) return std::nullopt;
    hosts.push_back(std::move(*host));
    if (comma == list.npos) return hosts;
    list.remove_prefix(comma + 1);
  }
}

}  // namespace

bool is_url(std::string_view text) noexcept {
  return text.find("://") != text.npos;
}

bool is_ipv6_address(std::string_view text) noexcept {
  constexpr int kGroupCount = 8;
  const std::size_t gap = text.find("::");
  if (gap == text.npos) return count_of_groups(text, true) == kGroupCount;
  const auto before = count_of_groups(text.substr(0, gap), false);
  const auto after = count_of_groups(text.substr(gap + 2), true);
  return before && after && *before + *after < kGroupCount;
}

std::string host_in_url(std::string_view host) {
  if (host.find(':') == host.npos) return std::string(host);
  const std::size_t percent = host.find('%');
  std::string text = "[" + std::string(host.substr(0, percent));
  if (percent != host.npos) text.append(kZoneMark).append(host.substr(percent + 1));
  return text + "]";
}

std::string host_and_port(std::string_view host, std::uint16_t port) {
  return host_in_url(host) + ":" + std::to_string(port);
}

std::string Url::authority() const {
  std::string text;
  for (const std::string& host : hosts)
    text.append(text.empty() ? "" : ",").append(host_in_url(host));
  return text + ":" + std::to_string(port);
}

std::string Url::text() const {
  return std::string(kScheme) + authority() + "/" + path;
}

// hp-10-1
std::optional<Url> parse_url(std::string_view text) {
  if (!text.starts_with(kScheme)) return std::nullopt;
  text.remove_prefix(kScheme.size());
  const std::size_t slash = text.find('/');
  if (slash == text.npos) return std::nullopt;
  const std::string_view authority = text.substr(0, slash);
  const std::string_view path = text.substr(slash + 1);
  const std::size_t colon = authority.rfind(':');
  if (colon == authority.npos) return std::nullopt;
  auto hosts = hosts_of(authority.substr(0, colon));
  if (!hosts || !is_valid_path(path)) return std::nullopt;
  const std::string_view port = authority.substr(colon + 1);
  Url url{.hosts = std::move(*hosts), .path = std::string(path)};
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), url.port);
  if (error != std::errc{} || end != port.data() + port.size() || url.port == 0) {
    return std::nullopt;
  }
  return url;
}

std::size_t similarity(std::string_view path, std::string_view other) noexcept {
  const std::size_t size = std::min(path.size(), other.size());
  const auto begin =
      std::mismatch(path.begin(), path.begin() + static_cast<std::ptrdiff_t>(size), other.begin());
  const auto common = static_cast<std::size_t>(begin.first - path.begin());
  const auto left = static_cast<std::ptrdiff_t>(size - common);
  const auto end = std::mismatch(path.rbegin(), path.rbegin() + left, other.rbegin());
  return common + static_cast<std::size_t>(end.first - path.rbegin());
}

bool is_valid_path(std::string_view path) noexcept {
  if (path.empty() || path.size() > kPathSizeMax) return false;
  char previous = '/';
  for (const char c : path) {
    if (c == '/' ? previous == '/' : !is_path_character(c)) return false;
    previous = c;
  }
  return previous != '/';
}

}  // namespace rtpm::wire
