#pragma once

#include <algorithm>
#include <string_view>

#include "frames.hpp"

/// A channel under test and a handmade server for it.
namespace rtpm::wire::test {

inline constexpr std::uint64_t kSession = 0xabcdef0000;

class ClientChannelTest : public testing::Test {
 protected:
  using Kind = ChannelEvent::Kind;

  explicit ClientChannelTest(Medium medium = Medium::kDatagram, std::uint16_t open_call_max = 1)
      : buffer_(kHeaderSize + 2000),
        channel_({.medium = medium,
                  .client_epoch = 77,
                  .channel = 5,
                  .clock_domain = 9,
                  .message_size_max = 3000,
                  .open_call_max = open_call_max},
                 buffer_) {}

  /// An answer to `sent`, as a server creates it.
  static Header answer_header(ConstBytes sent, FrameKind kind) {
    Header header = header_of(sent);
    header.kind = kind;
    header.flags = 0;
    header.item = 0;
    return header;
  }
  static Welcome welcome() {
    Welcome welcome;
    welcome.band = {100, 200};
    welcome.ceiling = 150;
    welcome.server_epoch = 88;
    welcome.clock_domain = 9;
    welcome.message_size_max = 1500;
    return welcome;
  }
  static Bytes welcome_frame(ConstBytes hello, const Welcome& welcome,
                             std::uint64_t session = kSession) {
    Header header = answer_header(hello, FrameKind::kWelcome);
    header.session = session;
    Bytes payload(Welcome::kSize);
    encode(welcome, payload);
    return frame_of(header, payload);
  }
  static Bytes cookie_frame(ConstBytes hello, std::byte fill) {
    return frame_of(answer_header(hello, FrameKind::kCookie), Bytes(16, fill));
  }
  static Bytes refuse_frame(ConstBytes sent, Status status) {
    Header header = answer_header(sent, FrameKind::kRefuse);
    header.status = status;
    return frame_of(header);
  }
  static Bytes reply_frame(ConstBytes call, std::string_view text, Status status = Status::kOk) {
    Header header = answer_header(call, FrameKind::kReply);
    header.status = status;
    return frame_of(header, bytes_of(text));
  }
  static CallParameters parameters(MonotonicTime deadline) {
    return {.service = 3, .method = 4, .priority = 120, .trace_id = 0x7ace, .deadline = deadline};
  }

  /// Opens the channel for priority 120 and gives it a session.
  void make_ready(MonotonicTime now) {
    const Bytes hello = copy_of(channel_.open(120, now + std::chrono::seconds{1}, now));
    ASSERT_EQ(channel_.on_frame(welcome_frame(hello, welcome()), now).kind, Kind::kReady);
  }
  /// Begins a call; returns a copy of its frame.
  Bytes begin_call(MonotonicTime now, Duration deadline = std::chrono::seconds{1}) {
    const auto frame = channel_.call(parameters(now + deadline), request_, now);
    EXPECT_TRUE(frame);
    return frame ? copy_of(*frame) : Bytes{};
  }
  std::uint64_t dropped(DropReason reason) const { return channel_.counters().dropped_for(reason); }

  const Bytes request_ = bytes_of("request");  ///< Lives as long as the calls.
  Bytes buffer_;
  ClientChannel channel_;
};

class StreamChannelTest : public ClientChannelTest {
 protected:
  StreamChannelTest() : ClientChannelTest(Medium::kStream) {}
};

}  // namespace rtpm::wire::test
