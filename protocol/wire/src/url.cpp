#include "rtpm/wire/url.hpp"

#include <algorithm>
#include <charconv>

#include "rtpm/wire/limits.hpp"

namespace rtpm::wire {
namespace {

constexpr std::string_view kScheme = "rtpm://";

bool is_path_character(char c) noexcept {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
         c == '_' || c == '-';
}

bool is_host_character(char c) noexcept {
  return is_path_character(c);
}

}  // namespace

bool is_url(std::string_view text) noexcept {
  return text.find("://") != text.npos;
}

std::optional<Url> parse_url(std::string_view text) {
  if (!text.starts_with(kScheme)) return std::nullopt;
  text.remove_prefix(kScheme.size());
  const std::size_t slash = text.find('/');
  if (slash == text.npos) return std::nullopt;
  const std::string_view authority = text.substr(0, slash);
  const std::string_view path = text.substr(slash + 1);
  const std::size_t colon = authority.find(':');
  if (colon == authority.npos || colon == 0) return std::nullopt;
  const std::string_view host = authority.substr(0, colon);
  const std::string_view port = authority.substr(colon + 1);
  Url url;
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), url.port);
  if (error != std::errc{} || end != port.data() + port.size() || url.port == 0) {
    return std::nullopt;
  }
  if (!std::all_of(host.begin(), host.end(), is_host_character) || !is_valid_path(path)) {
    return std::nullopt;
  }
  url.host = host;
  url.path = path;
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
