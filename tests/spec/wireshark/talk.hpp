#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <deque>
#include <memory>

#include "capture.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "rtpm/wire/control.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "vectors.hpp"

/// Conversations of our client with our server, for captures.
namespace rtpm::spec {

inline constexpr std::uint16_t kDefaultPort = 7420;
inline constexpr End kClient{.host = 1, .port = 4711};
inline constexpr End kServer{.host = 2, .port = kDefaultPort};
inline constexpr int kPriority = 24000;

[[nodiscard]] inline MonotonicTime at(Duration since_begin) {
  return time_from_ns(1'000'000'000) + since_begin;
}

using Column = std::vector<std::string>;

/// Tests that tshark takes part in.
class DissectorTest : public testing::Test {
 protected:
  void SetUp() override {
    if (const std::string why = why_no_tshark(); !why.empty()) GTEST_SKIP() << why;
  }
};

[[nodiscard]] inline Bytes bind_request() {
  Bytes bytes(64);
  bytes.resize(encode(wire::BindRequest{"lab/arm0", "lab.Arm", 0x1234}, bytes));
  return bytes;
}

[[nodiscard]] inline Bytes frame_with(wire::Header header, const Bytes& payload) {
  header.payload_size = header.message_size = static_cast<std::uint32_t>(payload.size());
  Bytes frame(wire::kHeaderSize);
  encode(header, frame.data());
  frame.insert(frame.end(), payload.begin(), payload.end());
  return frame;
}

/// Our client and our server in a conversation that is captured frame by frame.
class Talk {
 public:
  Talk(wire::Medium medium, std::uint16_t server_port)
      : medium_(medium), server_end_{.host = 2, .port = server_port} {
    wire::ServerSessionsConfig config;
    config.medium = medium;
    config.epoch = 0x5e12;
    config.message_size_max = 4000;
    config.large_memory = large_memory_;
    config.stream_memory = stream_memory_;
    server_ = std::make_unique<wire::ServerSessions>(config);
  }

  Capture capture;

  void open(Duration when) {
    Bytes frame = copy_of(client_.open(kPriority, kNever, at(when)));
    while (!frame.empty()) {
      sent_by_client(frame, when);
      const Bytes answer = copy_of(to_server(frame, when).frame);
      sent_by_server(answer, when + std::chrono::microseconds{100});
      frame = copy_of(client_.on_frame(answer, at(when + std::chrono::microseconds{100})).frame);
      when += std::chrono::microseconds{200};
    }
    EXPECT_TRUE(client_.is_ready());
  }
  Bytes call(std::uint32_t service, std::uint16_t method, const Bytes& payload, Duration when,
             Duration patience = std::chrono::milliseconds{20}) {
    return call({service, method, kPriority, 0x7ace, at(when + patience)}, payload, when);
  }
  /// Makes a call with a large request, and captures all its frames.
  Bytes call(wire::CallParameters parameters, const Bytes& payload, Duration when) {
    parameters.stream_buffers = {.frames = items_,
                                 .frame_size = wire::kDatagramPayloadSizeMax,
                                 .item = item_,
                                 .byte_window = wire::stream_bytes_first(medium_)};
    payloads_.push_back(payload);  // The call views it.
    const auto frame = client_.call(parameters, payloads_.back(), at(when));
    EXPECT_TRUE(frame);
    const Bytes first = copy_of(*frame);
    for (ConstBytes sent = first; !sent.empty(); sent = client_.next_frame(at(when)))
      sent_by_client(copy_of(sent), when);
    return first;
  }
  [[nodiscard]] wire::ServerSessions& server() { return *server_; }
  [[nodiscard]] wire::ClientChannel& client() { return client_; }
  Bytes repeat(Duration when) {
    const Bytes frame = copy_of(client_.repeat(at(when)).frame);
    sent_by_client(frame, when);
    return frame;
  }
  wire::Verdict to_server(const Bytes& frame, Duration when) {
    return server_->on_frame(frame, {.low = 1}, at(when));
  }
  Bytes complete(const wire::Verdict& verdict, const Bytes& payload, Duration when) {
    EXPECT_EQ(verdict.action, wire::Verdict::Action::kDispatch);
    std::ranges::copy(payload, server_->reply_buffer(verdict.request, at(when)).begin());
    return copy_of(server_->complete(verdict.request, wire::Status::kOk,
                                     static_cast<std::uint32_t>(payload.size()), at(when)));
  }
  void to_client(const Bytes& frame, Duration when) {
    EXPECT_EQ(client_.on_frame(frame, at(when)).kind, wire::ChannelEvent::Kind::kReply);
  }
  /// A call that is answered 300 µs later, 200 of them at the server; returns the reply.
  Bytes exchange(std::uint32_t service, std::uint16_t method, const Bytes& request,
                 const Bytes& reply, Duration when) {
    const wire::Verdict verdict =
        to_server(call(service, method, request, when), when + std::chrono::microseconds{50});
    const Bytes frame = complete(verdict, reply, when + std::chrono::microseconds{250});
    sent_by_server(frame, when + std::chrono::microseconds{300});
    to_client(frame, when + std::chrono::microseconds{300});
    return frame;
  }
  void sent_by_client(const Bytes& frame, Duration when) {
    send(kClient, server_end_, frame, when);
  }
  void sent_by_server(const Bytes& frame, Duration when) {
    send(server_end_, kClient, frame, when);
  }
  /// Bytes of a stream, regardless of frame boundaries.
  void segment_by_client(ConstBytes bytes, Duration when) {
    capture.add_segment(kClient, server_end_, bytes, at(when));
  }
  static Bytes copy_of(ConstBytes bytes) { return {bytes.begin(), bytes.end()}; }
  [[nodiscard]] std::uint64_t session() const { return client_.session(); }

 private:
  void send(End from, End to, const Bytes& frame, Duration when) {
    if (frame.empty()) return;
    if (medium_ == wire::Medium::kDatagram) {
      capture.add_datagram(from, to, frame, at(when));
    } else {
      capture.add_segment(from, to, frame, at(when));
    }
  }

  wire::Medium medium_;
  End server_end_;
  Bytes large_memory_ = Bytes(3 * 4032);
  Bytes stream_memory_ = Bytes(stream_buffer_size(medium_));
  Bytes items_ = Bytes(8 * wire::kDatagramPayloadSizeMax);
  Bytes item_ = Bytes(4000);
  std::unique_ptr<wire::ServerSessions> server_;
  std::array<std::byte, 4096> buffer_{};
  std::deque<Bytes> payloads_;
  wire::ClientChannel client_{
      {.medium = medium_, .client_epoch = 0xc11e47, .channel = 3, .message_size_max = 4000},
      buffer_};
};

}  // namespace rtpm::spec
