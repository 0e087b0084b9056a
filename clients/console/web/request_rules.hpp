#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

/// Decides which HTTP requests are answered; pure functions on untrusted text.
namespace rtpm::console {

/// The target of a request: "/app/x.js?token=…".
struct RequestTarget {
  std::string path{};   ///< Decoded.
  std::string token{};  ///< Empty if none.
  std::string to{};     ///< For the gateway; empty if none.
};
/// @return nullopt if malformed, or if the path contains an invalid byte
[[nodiscard]] std::optional<RequestTarget> read_target(std::string_view target);

/// Whether `host`, a Host header, names this server: localhost, a loopback address or one of
/// `names`, with any port or none. Any other name might resolve to this host because of DNS
/// rebinding. The port is not compared, because an SSH tunnel has a different port.
[[nodiscard]] bool is_own_host(std::string_view host, std::span<const std::string> names);

/// Whether `origin`, an Origin header, is a page of this server, whose Host header is `host`.
[[nodiscard]] bool is_own_origin(std::string_view origin, std::string_view host);

/// Selects the answer to `offered`, a Sec-WebSocket-Protocol header; empty if RTPM supports none of
/// the offered sub-protocols.
[[nodiscard]] std::string_view choose_subprotocol(std::string_view offered);

/// Whether `offered`, a Sec-WebSocket-Protocol header, has `wanted`.
[[nodiscard]] bool offers_subprotocol(std::string_view offered, std::string_view wanted);

/// The media type, by the file name; "application/octet-stream" if unknown.
[[nodiscard]] std::string_view media_type(std::string_view file);

/// The Content-Security-Policy for a page that may only connect to `host`.
[[nodiscard]] std::string content_security_policy(std::string_view host);

/// The regular file that `path` names below `folder`; for "/" and folders, their index.html.
/// @return nullopt if there is no such file, or it is outside, because of "..", a link, or a hidden
///         name
[[nodiscard]] std::optional<std::filesystem::path> find_page_file(
    const std::filesystem::path& folder, std::string_view path);

}  // namespace rtpm::console
