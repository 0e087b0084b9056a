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

TEST_F(ClientHandshake, EndsAtItsDeadlineRatherThanWithACopy) {
  static_cast<void>(channel_.open(120, at(kRetransmitIntervalFirst), at(0s)));
  EXPECT_EQ(channel_.on_time(at(kRetransmitIntervalFirst)).kind, Kind::kTimeout);
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
