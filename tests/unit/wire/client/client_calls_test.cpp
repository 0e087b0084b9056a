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

class ClientCallsOnAStream : public StreamChannelTest {
 protected:
  void SetUp() override { make_ready(at(0s)); }
};

TEST_F(ClientCalls, CarryWhatTheyAreGiven) {
  const auto frame = channel_.call(parameters(at(1500us) + 1ns), request_, at(1ms));
  ASSERT_TRUE(frame);
  const Header header = header_of(*frame);
  EXPECT_EQ(header.kind, FrameKind::kCall);
  EXPECT_EQ(header.session, kSession);
  EXPECT_EQ(header.service, 3u);
  EXPECT_EQ(header.method, 4u);
  EXPECT_EQ(header.priority, Priority{120});
  EXPECT_EQ(header.trace_id, 0x7aceu);
  EXPECT_EQ(header.flags, 0u);
  EXPECT_EQ(header.status, Status::kOk);
  EXPECT_EQ(header.sender_time_ns, static_cast<std::uint64_t>(to_ns(at(1ms))));
  EXPECT_EQ(header.budget_us, 501u) << "rounded up (hp-5.4-1)";
  EXPECT_EQ(header.item, 0u) << "it is no stream";
  EXPECT_EQ(payload_of(*frame), request_);
  EXPECT_EQ(channel_.call_begun(), at(1ms));
}

// hp-5.4-1
TEST_F(ClientCalls, StateTheirBudgetWithinItsRange) {
  const auto budget_of = [this](MonotonicTime deadline) {
    const auto frame = channel_.call(parameters(deadline), {}, at(0s));
    const std::uint32_t budget_us = header_of(*frame).budget_us;
    EXPECT_EQ(channel_.on_frame(reply_frame(copy_of(*frame), ""), at(0s)).kind, Kind::kReply);
    return budget_us;
  };
  EXPECT_EQ(budget_of(at(0s)), 0u) << "nobody waits any more";
  EXPECT_EQ(budget_of(at(-1s)), 0u);
  EXPECT_EQ(budget_of(at(1ns)), 1u) << "time is left, so it is not 0";
  EXPECT_EQ(budget_of(at(1us)), 1u);
  EXPECT_EQ(budget_of(at(24h)), std::numeric_limits<std::uint32_t>::max());
  EXPECT_EQ(budget_of(kNever), std::numeric_limits<std::uint32_t>::max());
}

TEST_F(ClientCalls, MayWaitForEverFromTheBeginOfTime) {
  const auto frame = channel_.call(parameters(kNever), {}, time_from_ns(0));
  EXPECT_EQ(header_of(*frame).budget_us, std::numeric_limits<std::uint32_t>::max());
}

TEST_F(ClientCalls, EndWithTheirReply) {
  const Bytes call = begin_call(at(0s));
  const Bytes reply = reply_frame(call, "result", Status::kServantFailed);
  const ChannelEvent event = channel_.on_frame(reply, at(1ms));
  EXPECT_EQ(event.kind, Kind::kReply);
  EXPECT_EQ(event.status, Status::kServantFailed);
  EXPECT_EQ(copy_of(event.payload), bytes_of("result"));
  EXPECT_EQ(channel_.next_time(), kNever);
  EXPECT_TRUE(channel_.is_ready());
  EXPECT_EQ(channel_.on_frame(reply, at(1ms)).kind, Kind::kNothing) << "a copy of the reply";
  EXPECT_EQ(dropped(DropReason::kUnexpected), 1u);
}

// hp-5.1-3
TEST_F(ClientCalls, TakeNoReplyThatIsNotTheirs) {
  const Bytes call = begin_call(at(0s));
  const auto offer = [&](auto change) {
    Header header = answer_header(call, FrameKind::kReply);
    change(header);
    return channel_.on_frame(frame_of(header), at(1ms)).kind;
  };
  EXPECT_EQ(offer([](Header& h) { ++h.session; }), Kind::kNothing);
  EXPECT_EQ(offer([](Header& h) { --h.call_id; }), Kind::kNothing);
  EXPECT_EQ(offer([](Header& h) { ++h.call_id; }), Kind::kNothing);
  EXPECT_EQ(offer([](Header& h) { ++h.service; }), Kind::kNothing);
  EXPECT_EQ(offer([](Header& h) { ++h.method; }), Kind::kNothing);
  EXPECT_EQ(dropped(DropReason::kUnexpected), 5u);
  EXPECT_EQ(offer([](Header& h) { h.flags = kFlagRepeated; }), Kind::kReply);
}

TEST_F(ClientCalls, TakeNoLateReplyToAnEarlierCall) {
  const Bytes former = begin_call(at(0s), 1ms);
  ASSERT_EQ(channel_.on_time(at(1ms)).kind, Kind::kTimeout);
  EXPECT_EQ(channel_.on_frame(reply_frame(former, "late"), at(2ms)).kind, Kind::kNothing)
      << "between two calls";
  const Bytes call = begin_call(at(3ms));
  EXPECT_EQ(channel_.on_frame(reply_frame(former, "late"), at(4ms)).kind, Kind::kNothing)
      << "during the next";
  EXPECT_EQ(channel_.on_frame(refuse_frame(former, Status::kUnknownSession), at(4ms)).kind,
            Kind::kNothing);
  EXPECT_EQ(copy_of(channel_.on_frame(reply_frame(call, "own"), at(5ms)).payload), bytes_of("own"));
}

// hp-5.1-1
TEST_F(ClientCalls, AreNumberedUpwardThroughAllSessions) {
  std::uint32_t last = header_of(begin_call(at(0s))).call_id;
  for (int session = 0; session < 3; ++session) {
    make_ready(at(0s));
    for (int i = 0; i < 3; ++i) {
      const Bytes call = begin_call(at(0s));
      EXPECT_EQ(header_of(call).call_id, ++last);
      ASSERT_EQ(channel_.on_frame(reply_frame(call, ""), at(0s)).kind, Kind::kReply);
    }
  }
}

// hp-5.3-2
TEST_F(ClientCalls, AreRepeatedAsTheyAreButForTime) {
  const Bytes first = begin_call(at(0s), 100ms);
  MonotonicTime now = at(0s);
  Duration wait = kRetransmitIntervalFirst;
  for (int copy = 1; copy <= 4; ++copy) {
    ASSERT_EQ(channel_.next_time(), now + wait);
    EXPECT_EQ(channel_.on_time(now + wait - 1ns).kind, Kind::kNothing);
    now += wait;
    wait *= 2;
    const ChannelEvent event = channel_.on_time(now);
    ASSERT_EQ(event.kind, Kind::kSend);
    const Header header = header_of(event.frame);
    EXPECT_EQ(header.flags, kFlagRepeated);
    EXPECT_EQ(header.budget_us, (at(100ms) - now) / 1us);
    EXPECT_EQ(header.sender_time_ns, static_cast<std::uint64_t>(to_ns(now)));
    Bytes restored = copy_of(event.frame);
    for (const auto& [offset, size] : {std::pair{6, 2}, {40, 4}, {48, 8}}) {
      std::copy_n(first.begin() + offset, size, restored.begin() + offset);
    }
    EXPECT_EQ(restored, first);
    EXPECT_EQ(channel_.repeat_count(), static_cast<std::uint64_t>(copy));
  }
}

// hp-5.3-3
TEST_F(ClientCalls, AreRepeatedAtLeastOnceASecond) {
  static_cast<void>(begin_call(at(0s), 60s));
  MonotonicTime last = at(0s);
  while (last < at(50s)) {
    const MonotonicTime next = channel_.next_time();
    ASSERT_LE(next - last, Duration{1s});
    ASSERT_EQ(channel_.on_time(next).kind, Kind::kSend);
    last = next;
  }
}

TEST_F(ClientCalls, EndAtTheirDeadline) {
  static_cast<void>(begin_call(at(0s), 3ms));
  EXPECT_EQ(channel_.next_time(), at(3ms));
  EXPECT_EQ(channel_.on_time(at(3ms) - 1ns).kind, Kind::kNothing);
  EXPECT_EQ(channel_.on_time(at(3ms)).kind, Kind::kTimeout);
  EXPECT_EQ(channel_.on_time(at(4ms)).kind, Kind::kNothing);
  EXPECT_TRUE(channel_.is_ready()) << "the session goes on";
}

TEST_F(ClientCalls, EndAtTheirDeadlineRatherThanWithACopy) {
  static_cast<void>(begin_call(at(0s), kRetransmitIntervalFirst));
  EXPECT_EQ(channel_.on_time(at(1s)).kind, Kind::kTimeout) << "both are long due";
}

TEST_F(ClientCalls, MeasureTheRoundTrip) {
  for (int i = 0; i < 20; ++i) {
    const Bytes call = begin_call(at(0s));
    ASSERT_EQ(channel_.on_frame(reply_frame(call, ""), at(100us)).kind, Kind::kReply);
  }
  EXPECT_EQ(channel_.round_trip().smoothed(), Duration{100us});
  static_cast<void>(begin_call(at(0s)));
  EXPECT_EQ(channel_.next_time(), at(kRetransmitIntervalMin));
}

// hp-5.3-1: no frame is lost between processes of one host, so a late server is not hurried.
TEST_F(ClientCalls, AreRepeatedLaterWhereNoFrameLeavesTheHost) {
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
TEST_F(ClientCalls, AreLostWhereTheSessionIsUnknown) {
  const Bytes call = begin_call(at(0s));
  const ChannelEvent event =
      channel_.on_frame(refuse_frame(call, Status::kUnknownSession), at(1ms));
  EXPECT_EQ(event.kind, Kind::kLost);
  EXPECT_FALSE(channel_.is_ready());
  EXPECT_EQ(channel_.next_time(), kNever);
}

TEST_F(ClientCalls, EndWithARefusalAsWithAReply) {
  const Bytes call = begin_call(at(0s));
  const ChannelEvent event = channel_.on_frame(refuse_frame(call, Status::kOverload), at(1ms));
  EXPECT_EQ(event.kind, Kind::kReply);
  EXPECT_EQ(event.status, Status::kOverload);
  EXPECT_TRUE(channel_.is_ready());
}

// hp-4.4-4: another lane of the server refuses the call; the session is valid.
TEST_F(ClientCalls, ThatReachedAnotherLaneLoseNoSession) {
  const Bytes call = begin_call(at(0s));
  const ChannelEvent event = channel_.on_frame(refuse_frame(call, Status::kWrongBand), at(1ms));
  EXPECT_EQ(event.kind, Kind::kReply);
  EXPECT_EQ(event.status, Status::kWrongBand);
  EXPECT_TRUE(channel_.is_ready());
  const Bytes next = begin_call(at(2ms));
  EXPECT_EQ(header_of(next).session, kSession);
  EXPECT_EQ(channel_.on_frame(reply_frame(next, ""), at(3ms)).kind, Kind::kReply);
}

// hp-5.1-8
TEST_F(ClientCalls, OutsideTheBandAreNotBegun) {
  for (const int priority : {99, 201, 0, Priority::kHighest}) {
    CallParameters outside = parameters(at(1s));
    outside.priority = priority;
    const auto frame = channel_.call(outside, request_, at(0s));
    ASSERT_FALSE(frame) << priority;
    EXPECT_EQ(frame.error(), Status::kWrongBand);
  }
  EXPECT_EQ(channel_.next_time(), kNever);
  EXPECT_TRUE(channel_.call(parameters(at(1s)), request_, at(0s)));
}

// hp-5.5-2
TEST(LostCalls, HaveNotRunOnlyIfTheServerWouldRememberTheirSession) {
  EXPECT_TRUE(has_not_run(7, 7, at(1s), at(1s)));
  EXPECT_TRUE(has_not_run(7, 7, at(1s), at(1s) + kSessionIdleMin - 1ns));
  EXPECT_FALSE(has_not_run(7, 7, at(1s), at(1s) + kSessionIdleMin));
  EXPECT_FALSE(has_not_run(7, 8, at(1s), at(1s))) << "another life may have run it";
}

// hp-4.4-3: taken as a reply, it would tell the caller that a method ran which did not.
TEST_F(ClientCalls, AreNotEndedByARefusalWithoutAReason) {
  const Bytes call = begin_call(at(0s));
  EXPECT_EQ(channel_.on_frame(refuse_frame(call, Status::kOk), at(1ms)).kind, Kind::kNothing);
  EXPECT_EQ(dropped(DropReason::kUnexpected), 1u);
  EXPECT_EQ(channel_.on_frame(reply_frame(call, ""), at(1ms)).kind, Kind::kReply);
}

TEST_F(ClientCalls, AreNotEndedByARefusalOfAnother) {
  const Bytes call = begin_call(at(0s));
  Header header = answer_header(call, FrameKind::kRefuse);
  header.status = Status::kUnknownSession;
  ++header.session;
  EXPECT_EQ(channel_.on_frame(frame_of(header), at(1ms)).kind, Kind::kNothing);
  header.session = 0;
  EXPECT_EQ(channel_.on_frame(frame_of(header), at(1ms)).kind, Kind::kNothing);
  EXPECT_EQ(dropped(DropReason::kUnexpected), 2u);
}

// hp-4.3-2
TEST_F(ClientCalls, TooLargeForTheServerAreNotBegun) {
  const Bytes too_large(1501);
  const Bytes largest(1500);
  const auto frame = channel_.call(parameters(at(1s)), too_large, at(0s));
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error(), Status::kTooLarge);
  EXPECT_EQ(channel_.next_time(), kNever);
  EXPECT_TRUE(channel_.call(parameters(at(1s)), largest, at(0s)));
}

// hp-5.6: a frame larger than the buffer is sent in fragments.
TEST_F(ClientCalls, TooLargeForTheBufferGoInFragments) {
  Welcome generous = welcome();
  generous.message_size_max = kMessageSizeCeiling;
  const Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
  ASSERT_EQ(channel_.on_frame(welcome_frame(hello, generous), at(0s)).kind, Kind::kReady);
  const Bytes message(kDatagramPayloadSizeMax + 1);
  const auto frame = channel_.call(parameters(at(1s)), message, at(0s));
  ASSERT_TRUE(frame);
  EXPECT_EQ(header_of(*frame).fragment_count, 2u);
}

// hp-5.7-1, hp-5.7-3
TEST_F(ClientCalls, TellTheServersClockUnlessTheyWereRepeated) {
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

TEST_F(ClientCalls, AreNotDisturbedByGarbage) {
  const Bytes call = begin_call(at(0s));
  Random random(1);
  for (int round = 0; round < 20'000; ++round) {
    Bytes frame = random_bytes(random, random() % 200);
    if (random() % 2 == 0) {
      Header header = random_header(random);
      // A CLOSE of the session itself is not a foreign frame.
      if (random() % 2 == 0 && header.kind != FrameKind::kClose) header.session = kSession;
      frame = frame_of(header, frame);
    }
    const ChannelEvent event = channel_.on_frame(frame, at(1ms));
    // hp-5.9-3: a server that sends unrequested items is asked to stop.
    const bool is_cancel = event.kind == Kind::kSend &&
                           header_of(event.frame).kind == FrameKind::kCancel &&
                           header_of(frame).kind == FrameKind::kItem;
    ASSERT_TRUE(event.kind == Kind::kNothing || is_cancel);
  }
  EXPECT_EQ(channel_.counters().received_count, 20'001u) << "these and the WELCOME";
  EXPECT_EQ(channel_.on_frame(reply_frame(call, "own"), at(1ms)).kind, Kind::kReply);
}

TEST_F(ClientCalls, CountABadHeaderAndGoOn) {
  const Bytes call = begin_call(at(0s));
  Bytes bad = reply_frame(call, "");
  bad[2] = std::byte{9};
  EXPECT_EQ(channel_.on_frame(bad, at(1ms)).kind, Kind::kNothing);
  EXPECT_EQ(dropped(DropReason::kBadVersion), 1u);
  EXPECT_EQ(channel_.on_frame(reply_frame(call, ""), at(1ms)).kind, Kind::kReply);
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
TEST_F(ClientCalls, AskForNoOtherBufferOnceAReplyHasBegun) {
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
TEST_F(ClientCalls, SurviveEveryTimeThatAServerMayState) {
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

// hp-5.3-4
TEST_F(ClientCallsOnAStream, AreNotRepeated) {
  static_cast<void>(begin_call(at(0s), 10s));
  EXPECT_EQ(channel_.next_time(), at(10s));
  EXPECT_EQ(channel_.on_time(at(9s)).kind, Kind::kNothing);
  EXPECT_EQ(channel_.repeat(at(9s)).kind, Kind::kNothing);
  EXPECT_EQ(channel_.repeat_count(), 0u);
  EXPECT_EQ(channel_.on_time(at(10s)).kind, Kind::kTimeout);
}

// hp-8-2
TEST_F(ClientCallsOnAStream, EndWithTheConnectionAtABadHeader) {
  const Bytes call = begin_call(at(0s));
  Bytes bad = reply_frame(call, "");
  bad[0] = std::byte{0};
  EXPECT_EQ(channel_.on_frame(bad, at(1ms)).kind, Kind::kBroken);
  EXPECT_EQ(dropped(DropReason::kBadMagic), 1u);
}

TEST_F(ClientCallsOnAStream, GoOnAfterALateReply) {
  const Bytes former = begin_call(at(0s), 1ms);
  ASSERT_EQ(channel_.on_time(at(1ms)).kind, Kind::kTimeout);
  const Bytes call = begin_call(at(2ms));
  EXPECT_EQ(channel_.on_frame(reply_frame(former, "late"), at(3ms)).kind, Kind::kNothing);
  EXPECT_EQ(channel_.on_frame(reply_frame(call, "own"), at(3ms)).kind, Kind::kReply);
}

}  // namespace
}  // namespace rtpm::wire
