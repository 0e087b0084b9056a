#pragma once

#include <algorithm>
#include <string_view>

#include "frames.hpp"

/// A handmade client and a server configuration for it, for the tests of ServerSessions.
namespace rtpm::wire::test {

inline constexpr std::uint64_t kServerEpoch = 0x5e12;
inline constexpr std::uint64_t kServerClock = 0xc10c;

[[nodiscard]] inline ServerSessionsConfig server_config(Medium medium = Medium::kDatagram) {
  ServerSessionsConfig config;
  config.medium = medium;
  config.epoch = kServerEpoch;
  config.clock_domain = kServerClock;
  config.key = {.low = 1, .high = 2};
  config.session_count_max = 4;
  return config;
}

/// One channel of a client; the test sets each field.
struct Peer {
  PeerAddress address{.high = 0, .low = 0x7f00'0001, .port = 4711};
  std::uint64_t epoch = 77;
  std::uint64_t channel = 1;
  std::uint32_t handshake_number = 1;
  std::uint64_t clock_domain = 0;
  std::uint32_t message_size_max = kMessageSizeCeiling;
  Priority priority = 100;
  std::uint64_t session = 0;

  [[nodiscard]] Hello hello() const {
    Hello hello;
    hello.client_epoch = epoch;
    hello.channel = channel;
    hello.clock_domain = clock_domain;
    hello.message_size_max = message_size_max;
    return hello;
  }
  [[nodiscard]] Bytes hello_frame(const Hello& hello) const {
    Header header;
    header.kind = FrameKind::kHello;
    header.priority = priority;
    header.call_id = handshake_number;
    Bytes payload(Hello::kSize);
    encode(hello, payload);
    return frame_of(header, payload);
  }
  [[nodiscard]] Bytes hello_frame() const { return hello_frame(hello()); }
  /// The HELLO with the cookie that the server issues for it.
  [[nodiscard]] Bytes proven_hello_frame(ServerSessions& server, MonotonicTime now) const {
    const Verdict verdict = server.on_frame(hello_frame(), address, now);
    Hello proven = hello();
    const Bytes cookie = payload_of(verdict.frame);
    EXPECT_EQ(cookie.size(), proven.cookie.size());
    std::ranges::copy(cookie, proven.cookie.begin());
    return hello_frame(proven);
  }
  /// Shakes hands as far as the medium needs; returns the header of the server's last answer and
  /// stores the session that it names.
  Header open(ServerSessions& server, MonotonicTime now, Medium medium = Medium::kDatagram) {
    const Bytes frame =
        medium == Medium::kDatagram ? proven_hello_frame(server, now) : hello_frame();
    const Header answer = header_of(server.on_frame(frame, address, now).frame);
    session = answer.kind == FrameKind::kWelcome ? answer.session : 0;
    return answer;
  }

  [[nodiscard]] Header call_header(std::uint32_t call_id) const {
    Header header;
    header.kind = FrameKind::kCall;
    header.priority = priority;
    header.session = session;
    header.call_id = call_id;
    header.service = 3;
    header.method = 4;
    header.budget_us = 1'000'000;
    header.trace_id = 0x7ace;
    return header;
  }
  [[nodiscard]] Bytes call_frame(std::uint32_t call_id, std::string_view payload = "") const {
    return frame_of(call_header(call_id), bytes_of(payload));
  }
};

/// Completes `request` with `text` as its reply, like a lane.
[[nodiscard]] inline Bytes answer(ServerSessions& server, const Request& request,
                                  std::string_view text, MonotonicTime now,
                                  Status status = Status::kOk) {
  const MutableBytes reply = server.reply_buffer(request, now);
  EXPECT_LE(text.size(), reply.size());
  std::ranges::copy(bytes_of(text), reply.begin());
  return copy_of(server.complete(request, status, static_cast<std::uint32_t>(text.size()), now));
}

}  // namespace rtpm::wire::test
