#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/time.hpp"
#include "web/send_queue.hpp"

namespace rtpm::console {

/// Why a client may not command.
inline constexpr std::string_view kNoToken =
    "read-only: open the URL with the token that rtpm-console printed";
inline constexpr std::string_view kReadOnly =
    "read-only: this console was started with --read-only";

/// Why a connection is closed; the numbers are those of RFC 6455.
enum class CloseCode : std::uint16_t {
  kGoingAway = 1001,
  kProtocolError = 1002,
  kTooBig = 1009,
  kTryAgainLater = 1013
};

/// A client, as the handler sees it.
/// @threads  the web server's thread
class Connection {
 public:
  Connection() = default;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  virtual ~Connection() = default;

  /// Counts from 1; never repeats.
  [[nodiscard]] virtual std::uint64_t id() const noexcept = 0;
  /// Whether the client may command: it presented the token, and the server is not read-only.
  [[nodiscard]] bool may_command() const noexcept { return refusal().empty(); }
  /// The refusal of its commands; empty if it may command.
  [[nodiscard]] virtual std::string_view refusal() const noexcept = 0;
  /// Whether the client presented a wrong token.
  [[nodiscard]] virtual bool has_wrong_token() const noexcept = 0;
  /// How many messages were dropped because the client reads too slowly.
  [[nodiscard]] virtual std::uint64_t dropped_count() const noexcept = 0;

  /// Sends a text frame that must arrive. Disconnects a client that does not read it.
  virtual void send_text(SharedText text) = 0;
  /// Sends a binary frame that must arrive. Disconnects a client that does not read it.
  virtual void send_binary(SharedText bytes) = 0;
  /// Sends a subscription's message; drops older ones if the client is slow.
  virtual void send_message(std::uint32_t subscription_id, std::uint64_t log_time_ns,
                            SharedText payload) = 0;
  /// Sends a picture: a key frame replaces the subscription's pictures that wait; see
  /// SendQueue::push_picture().
  virtual void send_picture(std::uint32_t subscription_id, std::uint64_t log_time_ns,
                            SharedText payload, bool is_key) = 0;
  virtual void close(CloseCode code, std::string_view reason) = 0;
};

/// Answers clients.
/// @threads  called on the web server's thread
class ConnectionHandler {
 public:
  ConnectionHandler() = default;
  ConnectionHandler(const ConnectionHandler&) = delete;
  ConnectionHandler& operator=(const ConnectionHandler&) = delete;
  virtual ~ConnectionHandler() = default;

  virtual void on_open(Connection& connection) = 0;
  virtual void on_text(Connection& connection, std::string_view text) = 0;
  virtual void on_binary(Connection& connection, ConstBytes bytes) = 0;
  /// Handles the end of a connection, which must not be used after this returns.
  /// @param since  when it ended; for a silent connection, when it was last heard
  virtual void on_close(Connection& connection, MonotonicTime since) = 0;
};

}  // namespace rtpm::console
