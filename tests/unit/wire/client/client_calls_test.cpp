#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "client_fixture.hpp"

// A client's calls: spec/hprotocol.md#hp-5.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;

class ClientCalls : public ClientChannelTest {
 protected:
  void SetUp() override { make_ready(at(0s)); }
};

// hp-5.4-1
TEST_F(ClientCalls, StateTheirBudgetWithinItsRange) {
  const auto budget_of = [this](MonotonicTime deadline) {
    const auto frame = channel_.call(parameters(deadline), {}, at(0s));
    const std::uint32_t budget_us = header_of(*frame).budget_us;
    EXPECT_EQ(channel_.on_frame(reply_frame(copy_of(*frame), ""), at(0s)).kind, Kind::kReply);
    return budget_us;
  };
  EXPECT_EQ(budget_of(at(0s)), 0u) << "the caller no longer waits";
  EXPECT_EQ(budget_of(at(-1s)), 0u);
  EXPECT_EQ(budget_of(at(1ns)), 1u) << "time is left, so it is not 0";
  EXPECT_EQ(budget_of(at(1us)), 1u);
  EXPECT_EQ(budget_of(at(24h)), std::numeric_limits<std::uint32_t>::max());
  EXPECT_EQ(budget_of(kNever), std::numeric_limits<std::uint32_t>::max());
}

TEST_F(ClientCalls, TimeOutAtTheirDeadlineInsteadOfRepeating) {
  static_cast<void>(begin_call(at(0s), kRetransmitIntervalFirst));
  EXPECT_EQ(channel_.on_time(at(1s)).kind, Kind::kTimeout) << "both are long due";
}

// hp-5.3-1: no frame is lost between processes of one host, so a late server is not hurried.
TEST_F(ClientCalls, AreRepeatedLaterOnOneHost) {
  channel_.set_on_host(true);
  static_cast<void>(begin_call(at(0s)));
  EXPECT_EQ(channel_.next_time(), at(kRetransmitIntervalOnHost)) << "the first call, too";
  make_ready(at(0s));
  for (int i = 0; i < 20; ++i) {
    const Bytes call = begin_call(at(0s));
    ASSERT_EQ(channel_.on_frame(reply_frame(call, ""), at(100us)).kind, Kind::kReply);
  }
  static_cast<void>(begin_call(at(0s)));
  EXPECT_EQ(channel_.next_time(), at(kRetransmitIntervalOnHost));
  EXPECT_EQ(channel_.on_time(at(kRetransmitIntervalOnHost)).kind, Kind::kSend);
}

TEST_F(ClientCalls, CanBeRepeatedAtOnce) {
  EXPECT_EQ(channel_.repeat(at(0s)).kind, Kind::kNothing) << "there is no call";
  const Bytes call = begin_call(at(0s));
  const ChannelEvent event = channel_.repeat(at(1ms));
  ASSERT_EQ(event.kind, Kind::kSend);
  EXPECT_EQ(header_of(event.frame).call_id, header_of(call).call_id);
  EXPECT_EQ(header_of(event.frame).flags, kFlagRepeated);
}

// hp-5.5-2
TEST(LostCalls, HaveNotRunIfTheServerStillKeepsTheirSession) {
  EXPECT_TRUE(has_not_run(7, 7, at(1s), at(1s)));
  EXPECT_TRUE(has_not_run(7, 7, at(1s), at(1s) + kSessionIdleMin - 1ns));
  EXPECT_FALSE(has_not_run(7, 7, at(1s), at(1s) + kSessionIdleMin));
  EXPECT_FALSE(has_not_run(7, 8, at(1s), at(1s))) << "another life may have run it";
}

// hp-5.7-1, hp-5.7-3
TEST_F(ClientCalls, MeasureTheServersClockUnlessRepeated) {
  EXPECT_EQ(channel_.peer_clock(at(0s))->uncertainty, 0s) << "it reads the same clock";
  Welcome stranger = welcome();
  stranger.clock_domain = 10;
  const Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
  ASSERT_EQ(channel_.on_frame(welcome_frame(hello, stranger), at(0s)).kind, Kind::kReady);
  EXPECT_FALSE(channel_.peer_clock(at(0s)));

  const auto answered_at = [&](const Bytes& call, MonotonicTime theirs) {
    Header header = answer_header(call, FrameKind::kReply);
    header.budget_us = 300;
    header.sender_time_ns = static_cast<std::uint64_t>(to_ns(theirs));
    return frame_of(header);
  };
  const Bytes repeated = begin_call(at(0s));
  ASSERT_EQ(channel_.on_time(channel_.next_time()).kind, Kind::kSend);
  ASSERT_EQ(channel_.on_frame(answered_at(repeated, at(1h)), at(100ms)).kind, Kind::kReply);
  EXPECT_FALSE(channel_.peer_clock(at(100ms)));

  const Bytes once = begin_call(at(200ms));
  // 100 us to the server, 300 us in it, 100 us back.
  ASSERT_EQ(channel_.on_frame(answered_at(once, at(200ms + 400us + 1h)), at(200ms + 500us)).kind,
            Kind::kReply);
  const auto clock = channel_.peer_clock(at(200ms + 500us));
  ASSERT_TRUE(clock);
  EXPECT_EQ(clock->offset, 1h);
  EXPECT_LT(clock->uncertainty, 110us);
}

TEST_F(ClientCalls, EndWithTheSession) {
  const Bytes call = begin_call(at(0s));
  const Header close = header_of(channel_.close(at(1ms)));
  EXPECT_EQ(close.kind, FrameKind::kClose);
  EXPECT_EQ(close.session, kSession);
  EXPECT_EQ(close.priority, Priority{120}) << "it steers the frame to the session's lane";
  EXPECT_FALSE(channel_.is_ready());
  EXPECT_EQ(channel_.next_time(), kNever);
  EXPECT_EQ(channel_.on_frame(reply_frame(call, ""), at(1ms)).kind, Kind::kNothing);

  make_ready(at(2ms));
  static_cast<void>(begin_call(at(2ms)));
  channel_.reset();
  EXPECT_FALSE(channel_.is_ready());
  EXPECT_EQ(channel_.next_time(), kNever);
}

/// A fragment of a reply of `message_size` bytes in fragments of `fragment_size`.
Bytes reply_fragment(ConstBytes call, std::uint32_t message_size, std::uint32_t fragment_size,
                     std::uint16_t index) {
  Header header = header_of(call);
  header.kind = FrameKind::kReply;
  header.flags = 0;
  header.fragment_index = index;
  header.fragment_count =
      static_cast<std::uint16_t>((message_size + fragment_size - 1) / fragment_size);
  header.message_size = message_size;
  header.payload_size = std::min(fragment_size, message_size - index * fragment_size);
  Bytes frame(kHeaderSize + header.payload_size, static_cast<std::byte>(index + 1));
  encode(header, frame.data());
  return frame;
}

// Another buffer would take the first one away from the reply in progress.
TEST_F(ClientCalls, KeepTheBufferOfAReplyThatHasBegun) {
  const Bytes call = begin_call(at(0s));
  const Bytes first = reply_fragment(call, 2000, 1000, 0);
  EXPECT_EQ(channel_.on_frame(first, at(1ms)).kind, Kind::kNeedBuffer);
  Bytes buffer(2000);
  channel_.set_reply_buffer(buffer);
  EXPECT_NE(channel_.on_frame(first, at(1ms)).kind, Kind::kNeedBuffer);
  const Bytes larger = reply_fragment(call, 2900, 1000, 0);
  EXPECT_EQ(channel_.on_frame(larger, at(1ms)).kind, Kind::kNothing);
  EXPECT_EQ(dropped(DropReason::kBadFragment), 1u);
  const ChannelEvent event = channel_.on_frame(reply_fragment(call, 2000, 1000, 1), at(1ms));
  ASSERT_EQ(event.kind, Kind::kReply);
  EXPECT_EQ(event.payload.data(), buffer.data());
  EXPECT_EQ(event.payload.size(), 2000u);
}

// Any clock value from a server must be safe to compute with.
TEST_F(ClientCalls, AcceptAnyTimeOfAServer) {
  Welcome other_clock = welcome();
  other_clock.clock_domain = 10;
  const Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
  ASSERT_EQ(channel_.on_frame(welcome_frame(hello, other_clock), at(0s)).kind, Kind::kReady);
  constexpr std::uint64_t kHalf = std::uint64_t{1} << 63;
  for (const std::uint64_t time : {std::uint64_t{0}, std::uint64_t{1}, kHalf - 1, kHalf, kHalf + 1,
                                   ~std::uint64_t{0}, std::uint64_t{1} << 62}) {
    for (const std::uint32_t budget : {0u, 1u, ~0u}) {
      const Bytes call = begin_call(at(0s));
      Header header = answer_header(call, FrameKind::kReply);
      header.sender_time_ns = time;
      header.budget_us = budget;
      EXPECT_EQ(channel_.on_frame(frame_of(header), at(1ms)).kind, Kind::kReply);
      const auto clock = channel_.peer_clock(at(1h));
      EXPECT_TRUE(!clock || clock->uncertainty >= Duration{0});
    }
  }
}

}  // namespace
}  // namespace rtpm::wire
