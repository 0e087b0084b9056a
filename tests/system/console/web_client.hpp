#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/time.hpp"

/// A small client of HTTP and WebSocket that can also break the rules.
namespace rtpm::system_test {

/// A TCP connection to this host.
/// @threads  one
class Socket {
 public:
  explicit Socket(std::uint16_t port);
  Socket(Socket&& other) noexcept;
  Socket& operator=(Socket&& other) noexcept;
  ~Socket();

  [[nodiscard]] bool is_open() const noexcept { return handle_ >= 0; }
  /// Sends all bytes; false if the other end has closed.
  bool send(std::string_view bytes);
  /// Receives at least a byte; empty if nothing comes within `patience` or the other end closes.
  [[nodiscard]] std::string receive(Duration patience);
  /// Whether the other end closes within `patience`; drops its bytes before that.
  [[nodiscard]] bool is_closed_within(Duration patience);

 private:
  int handle_ = -1;
};

/// The whole answer to a request with these header lines, each ending with "\r\n".
[[nodiscard]] std::string http(std::uint16_t port, const std::string& request_line,
                               const std::string& headers);
/// "200" of "HTTP/1.1 200 OK…".
[[nodiscard]] std::string status_of(const std::string& answer);

/// A frame that a server sent.
struct WebFrame {
  std::uint8_t opcode = 0;  ///< 1 text, 2 binary, 8 close, 9 ping.
  std::string payload{};

  [[nodiscard]] bool is_text() const noexcept { return opcode == 1; }
  /// The code of a close frame; 0 if it has none.
  [[nodiscard]] int close_code() const noexcept;
};

/// A WebSocket, answering pings.
/// @threads  one
class WebClient {
 public:
  struct Options {
    std::string target = "/";
    std::string subprotocol = "foxglove.sdk.v1";
    std::string headers{};  ///< Further header lines.
  };
  WebClient(std::uint16_t port, const Options& options);

  /// The server's answer to the handshake.
  [[nodiscard]] const std::string& answer() const noexcept { return answer_; }
  [[nodiscard]] bool is_accepted() const { return status_of(answer_) == "101"; }
  [[nodiscard]] Socket& socket() noexcept { return socket_; }

  bool send_text(std::string_view text) { return send(1, text); }
  bool send_binary(std::string_view bytes) { return send(2, bytes); }
  /// Sends a frame, masked as clients must.
  bool send(std::uint8_t opcode, std::string_view payload);
  /// The next frame other than a ping; nullopt if none comes in time or the connection ends.
  [[nodiscard]] std::optional<WebFrame> next(Duration patience);

 private:
  [[nodiscard]] std::optional<WebFrame> take_frame();

  Socket socket_;
  std::string answer_{};
  std::string received_{};
};

}  // namespace rtpm::system_test
