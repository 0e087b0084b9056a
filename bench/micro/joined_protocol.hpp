#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <vector>

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/server_sessions.hpp"

/// The protocol without a transport.
namespace rtpm::bench::micro {

/// The header of a force loop's call.
inline wire::Header call_header() {
  wire::Header header;
  header.kind = wire::FrameKind::kCall;
  header.priority = 24000;
  header.session = 0x123456789abcdefULL;
  header.call_id = 1000;
  header.service = 3;
  header.method = 2;
  header.payload_size = 48;
  header.message_size = 48;
  header.budget_us = 800;
  header.sender_time_ns = 1'000'000'007;
  return header;
}

using CallFrame = std::array<std::byte, wire::kHeaderSize + 48>;

inline CallFrame call_frame() {
  alignas(16) CallFrame frame{};
  wire::encode(call_header(), frame.data());
  return frame;
}

/// A client's channel and a server's sessions, joined without any transport: what the protocol
/// itself costs.
class JoinedProtocol {
 public:
  /// Sets both up, with a handshake done, for messages of up to `message_size_max` bytes.
  explicit JoinedProtocol(std::uint32_t message_size_max)
      : large_(message_size_max > wire::kDatagramPayloadSizeMax ? 2 * message_size_max : 0),
        room_(message_size_max),
        payload_(message_size_max),
        channel_({.client_epoch = 7, .channel = 1, .message_size_max = message_size_max}, buffer_),
        sessions_({.band = {},
                   .epoch = 9,
                   .key = {.low = 1, .high = 2},
                   .session_count_max = 4,
                   .message_size_max = message_size_max,
                   .large_memory = large_}) {
    channel_.set_reply_buffer(room_);
    ConstBytes frame = channel_.open(Priority{1000}, now_ + kPatience, now_);
    while (!channel_.is_ready()) {
      const wire::Verdict verdict = sessions_.on_frame(frame, peer_, now_);
      RTPM_ASSERT(!verdict.frame.empty(), "the server answers a handshake");
      frame = channel_.on_frame(verdict.frame, now_).frame;
    }
  }

  /// One call that returns `size` bytes, from the encoding of its first frame to the decoding of
  /// its reply's last one.
  void call(std::size_t size) {
    now_ += Duration{1000};
    const auto begun = channel_.call(
        {.service = 1, .method = 2, .priority = Priority{1000}, .deadline = now_ + kPatience},
        ConstBytes(payload_).first(size), now_);
    RTPM_ASSERT(begun.has_value(), "a call can begin");
    is_replied_ = false;
    to_server(*begun);
    while (!is_replied_) {
      const ConstBytes more = channel_.next_frame(now_);
      RTPM_ASSERT(!more.empty(), "a call goes on until its reply is there");
      to_server(more);
    }
  }

 private:
  static constexpr Duration kPatience = std::chrono::seconds{10};

  void to_server(ConstBytes frame) {
    const wire::Verdict verdict = sessions_.on_frame(frame, peer_, now_);
    if (verdict.action == wire::Verdict::Action::kDispatch) {
      const MutableBytes reply = sessions_.reply_buffer(verdict.request, now_);
      const ConstBytes request = verdict.request.payload;
      std::memcpy(reply.data(), request.data(), request.size());
      to_client(sessions_.complete(verdict.request, wire::Status::kOk,
                                   static_cast<std::uint32_t>(request.size()), now_));
    } else {
      to_client(verdict.frame);
    }
    for (ConstBytes more = sessions_.next_frame(now_); !more.empty();
         more = sessions_.next_frame(now_)) {
      to_client(more);
    }
  }

  void to_client(ConstBytes frame) {
    if (frame.empty()) return;
    const wire::ChannelEvent event = channel_.on_frame(frame, now_);
    if (event.kind == wire::ChannelEvent::Kind::kReply) is_replied_ = true;
    if (!event.frame.empty()) to_server(event.frame);
  }

  alignas(64) std::array<std::byte, wire::kDatagramFrameSizeMax> buffer_{};
  std::vector<std::byte> large_;
  std::vector<std::byte> room_;
  std::vector<std::byte> payload_;
  MonotonicTime now_ = time_from_ns(1'000'000'000);
  wire::PeerAddress peer_{};
  wire::ClientChannel channel_;
  wire::ServerSessions sessions_;
  bool is_replied_ = false;
};

}  // namespace rtpm::bench::micro
