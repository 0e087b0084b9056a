#include <gtest/gtest.h>

#include "client_fixture.hpp"

// The client's half of the handshake: spec/hprotocol.md#hp-4.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;

class ClientHandshake : public ClientChannelTest {};
class ClientHandshakeOnAStream : public StreamChannelTest {};

Hello hello_of(ConstBytes frame) {
  const auto hello = decode_hello(payload_of(frame));
  EXPECT_TRUE(hello);
  return hello ? *hello : Hello{};
}

TEST_F(ClientHandshake, BeginsWithAHello) {
  const ConstBytes frame = channel_.open(120, at(1s), at(0s));
  const Header header = header_of(frame);
  EXPECT_EQ(header.kind, FrameKind::kHello);
  EXPECT_EQ(header.priority, Priority{120});
  EXPECT_EQ(header.session, 0u);
  EXPECT_EQ(header.flags, 0u);
  EXPECT_EQ(header.sender_time_ns, static_cast<std::uint64_t>(to_ns(at(0s))));
  const Hello hello = hello_of(frame);
  EXPECT_EQ(hello.version_min, kVersion);
  EXPECT_EQ(hello.version_max, kVersion);
  EXPECT_EQ(hello.features, 0u);
  EXPECT_EQ(hello.client_epoch, 77u);
  EXPECT_EQ(hello.channel, 5u);
  EXPECT_EQ(hello.clock_domain, 9u);
  EXPECT_EQ(hello.message_size_max, 3000u);
  EXPECT_EQ(hello.cookie, Cookie{});
  EXPECT_FALSE(channel_.is_ready());
}

// hp-4.2-3
TEST_F(ClientHandshake, AnswersACookieWithItsHello) {
  const Bytes first = copy_of(channel_.open(120, at(1s), at(0s)));
  const ChannelEvent event = channel_.on_frame(cookie_frame(first, std::byte{7}), at(1ms));
  ASSERT_EQ(event.kind, Kind::kSend);
  Cookie expected{};
  expected.fill(std::byte{7});
  EXPECT_EQ(hello_of(event.frame).cookie, expected);
  EXPECT_EQ(header_of(event.frame).call_id, header_of(first).call_id) << "the same handshake";
  EXPECT_EQ(header_of(event.frame).priority, Priority{120});
}

TEST_F(ClientHandshake, EndsWithTheSessionOfTheWelcome) {
  const Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
  EXPECT_EQ(channel_.on_frame(welcome_frame(hello, welcome()), at(1ms)).kind, Kind::kReady);
  EXPECT_TRUE(channel_.is_ready());
  EXPECT_EQ(channel_.session(), kSession);
  EXPECT_EQ(channel_.welcome().band, (Band{100, 200}));
  EXPECT_EQ(channel_.welcome().ceiling, Priority{150});
  EXPECT_EQ(channel_.welcome().server_epoch, 88u);
  EXPECT_EQ(channel_.welcome().message_size_max, 1500u);
  EXPECT_EQ(channel_.next_time(), kNever);
}

// hp-4-5
TEST_F(ClientHandshake, RepeatsItsHelloAtDoubledTimes) {
  const Bytes first = copy_of(channel_.open(120, at(10s), at(0s)));
  Duration wait = kRetransmitIntervalFirst;
  MonotonicTime now = at(0s);
  for (int copy = 0; copy < 12; ++copy) {
    ASSERT_EQ(channel_.next_time(), std::min(now + wait, at(10s)));
    if (channel_.next_time() == at(10s)) break;
    EXPECT_EQ(channel_.on_time(now + wait - 1ns).kind, Kind::kNothing);
    now += wait;
    const ChannelEvent event = channel_.on_time(now);
    ASSERT_EQ(event.kind, Kind::kSend);
    EXPECT_EQ(header_of(event.frame).flags, kFlagRepeated);
    EXPECT_EQ(header_of(event.frame).call_id, header_of(first).call_id);
    EXPECT_EQ(payload_of(event.frame), payload_of(first));
    wait = std::min<Duration>(2 * wait, kRetransmitIntervalMax);
  }
}

// hp-4.2-4: otherwise forged COOKIEs could make it send for ever.
TEST_F(ClientHandshake, AnswersOneCookieForEachHelloOfItsOwn) {
  const Bytes first = copy_of(channel_.open(120, at(1s), at(0s)));
  EXPECT_EQ(channel_.on_frame(cookie_frame(first, std::byte{7}), at(1ms)).kind, Kind::kSend);
  for (int i = 0; i < 10; ++i) {
    EXPECT_EQ(channel_.on_frame(cookie_frame(first, std::byte{8}), at(2ms)).kind, Kind::kNothing);
  }
  const ChannelEvent copy = channel_.on_time(channel_.next_time());
  ASSERT_EQ(copy.kind, Kind::kSend);
  EXPECT_EQ(hello_of(copy.frame).cookie[0], std::byte{8}) << "the last one goes with the copy";
  EXPECT_EQ(channel_.on_frame(cookie_frame(first, std::byte{9}), at(9ms)).kind, Kind::kSend);
  EXPECT_EQ(channel_.on_frame(cookie_frame(first, std::byte{9}), at(9ms)).kind, Kind::kNothing);
}

TEST_F(ClientHandshake, RepeatsTheCookieWithItsHello) {
  const Bytes first = copy_of(channel_.open(120, at(10s), at(0s)));
  ASSERT_EQ(channel_.on_frame(cookie_frame(first, std::byte{7}), at(1ms)).kind, Kind::kSend);
  const ChannelEvent event = channel_.on_time(at(5ms));
  ASSERT_EQ(event.kind, Kind::kSend);
  EXPECT_EQ(hello_of(event.frame).cookie[0], std::byte{7});
}

TEST_F(ClientHandshake, EndsAtItsDeadline) {
  const Bytes hello = copy_of(channel_.open(120, at(3ms), at(0s)));
  EXPECT_EQ(channel_.next_time(), at(3ms));
  EXPECT_EQ(channel_.on_time(at(3ms) - 1ns).kind, Kind::kNothing);
  EXPECT_EQ(channel_.on_time(at(3ms)).kind, Kind::kTimeout);
  EXPECT_EQ(channel_.next_time(), kNever);
  EXPECT_EQ(channel_.on_frame(welcome_frame(hello, welcome()), at(4ms)).kind, Kind::kNothing);
  EXPECT_FALSE(channel_.is_ready());
  EXPECT_EQ(dropped(DropReason::kUnexpected), 1u);
}

TEST_F(ClientHandshake, EndsAtItsDeadlineRatherThanWithACopy) {
  static_cast<void>(channel_.open(120, at(kRetransmitIntervalFirst), at(0s)));
  EXPECT_EQ(channel_.on_time(at(kRetransmitIntervalFirst)).kind, Kind::kTimeout);
}

TEST_F(ClientHandshake, EndsWithTheServersRefusal) {
  for (const Status status :
       {Status::kVersionUnsupported, Status::kBadLimits, Status::kWrongBand, Status::kOverload}) {
    const Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
    const ChannelEvent event = channel_.on_frame(refuse_frame(hello, status), at(1ms));
    EXPECT_EQ(event.kind, Kind::kRefused);
    EXPECT_EQ(event.status, status);
    EXPECT_FALSE(channel_.is_ready());
    EXPECT_EQ(channel_.next_time(), kNever);
  }
}

// hp-4-2, hp-4-3
TEST_F(ClientHandshake, HeedsNoAnswerToAnEarlierOne) {
  const Bytes former = copy_of(channel_.open(120, at(1s), at(0s)));
  const Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
  EXPECT_NE(header_of(former).call_id, header_of(hello).call_id);
  EXPECT_EQ(channel_.on_frame(cookie_frame(former, std::byte{7}), at(1ms)).kind, Kind::kNothing);
  EXPECT_EQ(channel_.on_frame(welcome_frame(former, welcome()), at(1ms)).kind, Kind::kNothing);
  EXPECT_EQ(channel_.on_frame(refuse_frame(former, Status::kOverload), at(1ms)).kind,
            Kind::kNothing);
  EXPECT_EQ(dropped(DropReason::kUnexpected), 3u);
  EXPECT_EQ(channel_.on_frame(welcome_frame(hello, welcome()), at(1ms)).kind, Kind::kReady);
}

TEST_F(ClientHandshake, HeedsNoAnswerBeforeItBeganOrAfterItEnded) {
  Header none;
  none.kind = FrameKind::kHello;
  const Bytes nothing = frame_of(none);
  EXPECT_EQ(channel_.on_frame(welcome_frame(nothing, welcome()), at(0s)).kind, Kind::kNothing);
  EXPECT_EQ(channel_.on_frame(cookie_frame(nothing, std::byte{1}), at(0s)).kind, Kind::kNothing);
  EXPECT_EQ(channel_.on_frame(refuse_frame(nothing, Status::kOverload), at(0s)).kind,
            Kind::kNothing);
  const Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
  ASSERT_EQ(channel_.on_frame(welcome_frame(hello, welcome()), at(0s)).kind, Kind::kReady);
  EXPECT_EQ(channel_.on_frame(welcome_frame(hello, welcome(), 0xbad), at(0s)).kind, Kind::kNothing);
  EXPECT_EQ(channel_.session(), kSession);
  EXPECT_EQ(dropped(DropReason::kUnexpected), 4u);
}

// hp-4.3-1
TEST_F(ClientHandshake, TakesNoWelcomeThatCanNotBeMeant) {
  const Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
  EXPECT_EQ(channel_.on_frame(welcome_frame(hello, welcome(), 0), at(0s)).kind, Kind::kNothing)
      << "session 0";
  Welcome other = welcome();
  other.band = {121, 200};
  EXPECT_EQ(channel_.on_frame(welcome_frame(hello, other), at(0s)).kind, Kind::kNothing)
      << "a band without the priority";
  other = welcome();
  other.window = 0;
  EXPECT_EQ(channel_.on_frame(welcome_frame(hello, other), at(0s)).kind, Kind::kNothing);
  Bytes longer = payload_of(welcome_frame(hello, welcome()));
  longer.push_back(std::byte{0});
  Header header = answer_header(hello, FrameKind::kWelcome);
  header.session = kSession;
  EXPECT_EQ(channel_.on_frame(frame_of(header, longer), at(0s)).kind, Kind::kNothing);
  EXPECT_EQ(dropped(DropReason::kBadPayload), 4u);
  EXPECT_FALSE(channel_.is_ready());
  EXPECT_EQ(channel_.on_frame(welcome_frame(hello, welcome()), at(0s)).kind, Kind::kReady)
      << "it still waits for a good one";
}

TEST_F(ClientHandshake, TakesNoCookieOfAnotherSize) {
  const Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
  for (const std::size_t size : {0u, 15u, 17u}) {
    const Bytes frame = frame_of(answer_header(hello, FrameKind::kCookie), Bytes(size));
    EXPECT_EQ(channel_.on_frame(frame, at(0s)).kind, Kind::kNothing) << size;
  }
  EXPECT_EQ(dropped(DropReason::kBadPayload), 3u);
}

TEST_F(ClientHandshake, TakesNoRefusalWithoutAReason) {
  const Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
  EXPECT_EQ(channel_.on_frame(refuse_frame(hello, Status::kOk), at(0s)).kind, Kind::kNothing);
  EXPECT_EQ(dropped(DropReason::kUnexpected), 1u);
}

TEST_F(ClientHandshake, EndsAnEarlierSession) {
  make_ready(at(0s));
  static_cast<void>(channel_.open(120, at(2s), at(1s)));
  EXPECT_FALSE(channel_.is_ready());
}

// hp-4-2: a client that restarts at its former address must not get its former session.
TEST_F(ClientHandshake, IsNumberedFromWhereItsLifeBegan) {
  alignas(16) std::array<std::byte, 256> buffer{};
  const auto number_of_first = [&](std::uint32_t drawn) {
    ClientChannel channel({.client_epoch = 1, .handshake_number = drawn}, buffer);
    const MonotonicTime now = time_from_ns(1'000'000'000);
    return decode_frame(channel.open(0, now + std::chrono::seconds{1}, now))->call_id;
  };
  EXPECT_EQ(number_of_first(4711), 4712u);
  EXPECT_EQ(number_of_first(0xffff'ffff), 0u);
}

// hp-3-1
TEST_F(ClientHandshake, DropsTheKindsThatOnlyServersReceive) {
  for (const FrameKind kind :
       {FrameKind::kHello, FrameKind::kCall, FrameKind::kCancel, FrameKind::kCredit}) {
    Header header;
    header.kind = kind;
    EXPECT_EQ(channel_.on_frame(frame_of(header), at(0s)).kind, Kind::kNothing);
  }
  EXPECT_EQ(dropped(DropReason::kBadKind), 4u);
}

TEST_F(ClientHandshakeOnAStream, RepeatsNothing) {
  static_cast<void>(channel_.open(120, at(1s), at(0s)));
  for (MonotonicTime now = at(0s); now < at(1s); now += 1ms) {
    ASSERT_EQ(channel_.on_time(now).kind, Kind::kNothing);
  }
  EXPECT_LE(channel_.next_time(), at(1s));
  EXPECT_EQ(channel_.on_time(at(1s)).kind, Kind::kTimeout);
}

TEST_F(ClientHandshakeOnAStream, HasNoCookies) {
  const Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
  EXPECT_EQ(channel_.on_frame(cookie_frame(hello, std::byte{7}), at(0s)).kind, Kind::kNothing);
  EXPECT_EQ(dropped(DropReason::kUnexpected), 1u);
  EXPECT_EQ(channel_.on_frame(welcome_frame(hello, welcome()), at(0s)).kind, Kind::kReady);
}

}  // namespace
}  // namespace rtpm::wire
