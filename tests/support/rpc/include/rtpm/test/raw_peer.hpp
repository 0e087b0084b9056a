#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "rtpm/wire/control.hpp"
#include "rtpm/wire/header.hpp"

namespace rtpm::test {

using Bytes = std::vector<std::byte>;

inline constexpr Duration kPatience = std::chrono::seconds{20};

/// A client that sends the frames that a test gives it, valid or not.
class RawPeer {
 public:
  RawPeer(rpc::Transport transport, std::uint16_t port, Priority priority = 0)
      : transport_(transport), priority_(priority) {
    auto opened = open_client(transport, port, priority);
    EXPECT_TRUE(opened) << opened.error().text();
    if (opened) client_ = std::move(*opened);
  }

  /// Shakes hands; false if the server refuses or does not answer.
  [[nodiscard]] bool open(Duration patience = kPatience) {
    Bytes buffer(wire::kHeaderSize + 1024);
    wire::ClientChannel channel({.medium = client_->medium(),
                                 .client_epoch = rt::random_u64(),
                                 .channel = 1,
                                 .clock_domain = 0,
                                 .message_size_max = 64 * 1024},
                                buffer);
    send(channel.open(priority_, rt::now() + patience, rt::now()));
    while (true) {
      const auto frame = receive(channel.next_time());
      if (is_closed_) return false;
      const wire::ChannelEvent event =
          frame ? channel.on_frame(*frame, rt::now()) : channel.on_time(rt::now());
      if (event.kind == wire::ChannelEvent::Kind::kSend) send(event.frame);
      if (event.kind == wire::ChannelEvent::Kind::kReady) break;
      if (event.kind != wire::ChannelEvent::Kind::kSend &&
          event.kind != wire::ChannelEvent::Kind::kNothing) {
        return false;
      }
    }
    session_ = channel.session();
    return true;
  }

  /// A call's frame; the object is number 1, the server's first.
  [[nodiscard]] Bytes call_frame(std::uint32_t call_id, std::uint16_t method,
                                 std::string_view payload = {}, std::uint32_t service = 1) const {
    wire::Header header;
    header.kind = wire::FrameKind::kCall;
    header.priority = priority_;
    header.session = session_;
    header.call_id = call_id;
    header.service = service;
    header.method = method;
    header.budget_us = 60'000'000;
    header.payload_size = header.message_size = static_cast<std::uint32_t>(payload.size());
    Bytes frame(wire::kHeaderSize + payload.size());
    wire::encode(header, frame.data());
    std::ranges::copy(std::as_bytes(std::span(payload)), frame.begin() + wire::kHeaderSize);
    return frame;
  }

  void send(ConstBytes bytes) { EXPECT_TRUE(client_->send(bytes)); }

  /// The next frame; nullopt if none comes until then, or the connection ends.
  [[nodiscard]] std::optional<Bytes> receive(MonotonicTime until = rt::now() + kPatience) {
    while (true) {
      const auto frame = client_->receive();
      if (frame) return Bytes(frame->begin(), frame->end());
      is_closed_ = frame.error() == transport::IoError::kClosed;
      if (is_closed_ || rt::now() >= until) return std::nullopt;
      client_->wait(until);
    }
  }
  /// The header of the next frame that answers call `call_id`.
  [[nodiscard]] std::optional<wire::Header> receive_answer(std::uint32_t call_id) {
    while (const auto frame = receive()) {
      const auto header = wire::decode_frame(*frame);
      if (header && header->call_id == call_id && header->kind != wire::FrameKind::kWelcome &&
          header->kind != wire::FrameKind::kCookie) {
        return *header;
      }
    }
    return std::nullopt;
  }

  [[nodiscard]] bool is_closed() const noexcept { return is_closed_; }
  [[nodiscard]] std::uint64_t session() const noexcept { return session_; }
  [[nodiscard]] int descriptor() const noexcept { return client_->descriptor(); }
  [[nodiscard]] rpc::Transport transport() const noexcept { return transport_; }

 private:
  static auto open_client(rpc::Transport transport, std::uint16_t port, Priority priority)
      -> expected<std::unique_ptr<transport::ClientTransport>, SetupError> {
    const MonotonicTime deadline = rt::now() + kPatience;
    switch (transport) {
      case rpc::Transport::kTcp:
        return transport::open_tcp_transport("127.0.0.1", port, priority, 1 << 20, deadline);
      case rpc::Transport::kSharedMemory:
        return transport::open_shared_memory_transport({"127.0.0.1", port}, priority, deadline);
      default:
        return transport::open_udp_transport("127.0.0.1", port, priority);
    }
  }

  rpc::Transport transport_;
  Priority priority_;
  std::unique_ptr<transport::ClientTransport> client_;
  std::uint64_t session_ = 0;
  bool is_closed_ = false;
};

}  // namespace rtpm::test
