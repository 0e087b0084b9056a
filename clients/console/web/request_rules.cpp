#include "web/request_rules.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <system_error>
#include <utility>

#include "foxglove/replies.hpp"

namespace rtpm::console {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kTargetSizeMax = 2048;
constexpr std::size_t kPortDigitMax = 5;

int digit_of(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::optional<std::string> decoded(std::string_view text) {
  std::string plain;
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '%') {
      if (text.size() - i < 3) return std::nullopt;
      const int high = digit_of(text[i + 1]);
      const int low = digit_of(text[i + 2]);
      if (high < 0 || low < 0) return std::nullopt;
      c = static_cast<char>(high * 16 + low);
      i += 2;
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return std::nullopt;
    plain += c;
  }
  return plain;
}

std::string lower(std::string_view text) {
  std::string small(text);
  std::ranges::transform(small, small.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return small;
}

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

}  // namespace

std::optional<RequestTarget> read_target(std::string_view target) {
  if (target.empty() || target.front() != '/' || target.size() > kTargetSizeMax) {
    return std::nullopt;
  }
  const std::size_t mark = std::min(target.find('?'), target.size());
  auto path = decoded(target.substr(0, mark));
  if (!path) return std::nullopt;
  RequestTarget read{std::move(*path), {}, {}};
  std::string_view query = target.substr(std::min(mark + 1, target.size()));
  while (!query.empty()) {
    const std::size_t end = std::min(query.find('&'), query.size());
    const std::string_view part = query.substr(0, end);
    const std::size_t equals = std::min(part.find('='), part.size());
    const std::string_view name = part.substr(0, equals);
    if (name == "token" || name == "to") {
      auto value = decoded(part.substr(std::min(equals + 1, part.size())));
      if (!value) return std::nullopt;
      (name == "token" ? read.token : read.to) = std::move(*value);
    }
    query.remove_prefix(std::min(end + 1, query.size()));
  }
  return read;
}

bool is_own_host(std::string_view host, std::span<const std::string> names) {
  std::string name = lower(host);
  const std::size_t colon = name.rfind(':');
  // The colons in "[::1]" do not start a port.
  if (colon != std::string::npos && name.find(']', colon) == std::string::npos) {
    const std::string_view port = std::string_view(name).substr(colon + 1);
    const bool is_number = !port.empty() && port.size() <= kPortDigitMax &&
                           std::ranges::all_of(port, [](char c) { return c >= '0' && c <= '9'; });
    if (!is_number) return false;
    name.resize(colon);
  }
  if (name == "localhost" || name == "127.0.0.1" || name == "[::1]") return true;
  return std::ranges::any_of(names, [&](const std::string& own) {
    const bool is_v6 = own.find(':') != std::string::npos;
    return name == (is_v6 ? "[" + lower(own) + "]" : lower(own));
  });
}

bool is_own_origin(std::string_view origin, std::string_view host) {
  return lower(origin) == "http://" + lower(host);
}

std::string_view choose_subprotocol(std::string_view offered) {
  for (const std::string_view spoken : foxglove::kSubprotocols) {
    if (offers_subprotocol(offered, spoken)) return spoken;
  }
  return {};
}

bool offers_subprotocol(std::string_view offered, std::string_view wanted) {
  while (!offered.empty()) {
    const std::size_t end = std::min(offered.find(','), offered.size());
    if (trimmed(offered.substr(0, end)) == wanted) return true;
    offered.remove_prefix(std::min(end + 1, offered.size()));
  }
  return false;
}

std::string_view media_type(std::string_view file) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 15> kTypes{{
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".mjs", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".json", "application/json"},
      {".map", "application/json"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".ico", "image/x-icon"},
      {".webp", "image/webp"},
      {".woff2", "font/woff2"},
      {".woff", "font/woff"},
      {".wasm", "application/wasm"},
      {".txt", "text/plain; charset=utf-8"},
      {".webmanifest", "application/manifest+json"},
  }};
  for (const auto& [ending, type] : kTypes) {
    if (file.ends_with(ending)) return type;
  }
  return "application/octet-stream";
}

std::string content_security_policy(std::string_view host) {
  // Prevents foreign characters in the policy.
  const bool is_plain = std::ranges::all_of(host, [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '.' || c == ':' || c == '[' || c == ']' || c == '-';
  });
  return "default-src 'self'; connect-src 'self'" +
         (is_plain && !host.empty() ? " ws://" + std::string(host) : std::string{}) +
         "; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; worker-src 'self' blob:; "
         "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
}

std::optional<fs::path> find_page_file(const fs::path& folder, std::string_view path) {
  if (!path.starts_with('/') || path.find('\\') != std::string_view::npos) return std::nullopt;
  fs::path relative;
  std::string_view rest = path.substr(1);
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('/'), rest.size());
    const std::string_view part = rest.substr(0, end);
    // Rejects "." and "..", too.
    if (part.empty() || part.front() == '.') return std::nullopt;
    relative /= part;
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  std::error_code error;
  const fs::path root = fs::canonical(folder, error);
  if (error) return std::nullopt;
  fs::path file = fs::canonical(root / relative, error);
  if (error) return std::nullopt;
  if (fs::is_directory(file, error)) file = fs::canonical(file / "index.html", error);
  if (error || !fs::is_regular_file(file, error) || error) return std::nullopt;
  const auto [at, end] = std::ranges::mismatch(root, file);
  if (at != root.end()) return std::nullopt;
  return file;
}

}  // namespace rtpm::console
