#include <gtest/gtest.h>

#include "client_fixture.hpp"

// The client's half of the handshake: spec/hprotocol.md#hp-4.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;

class ClientHandshake : public ClientChannelTest {};
class ClientHandshakeOnAStream : public StreamChannelTest {};

TEST_F(ClientHandshake, TimesOutAtItsDeadlineInsteadOfRepeating) {
  static_cast<void>(channel_.open(120, at(kRetransmitIntervalFirst), at(0s)));
  EXPECT_EQ(channel_.on_time(at(kRetransmitIntervalFirst)).kind, Kind::kTimeout);
}

TEST_F(ClientHandshake, EndsAnEarlierSession) {
  make_ready(at(0s));
  static_cast<void>(channel_.open(120, at(2s), at(1s)));
  EXPECT_FALSE(channel_.is_ready());
}

// hp-4-2: a client that restarts at its former address must not get its former session.
TEST_F(ClientHandshake, IsNumberedFromTheDrawnNumber) {
  alignas(16) std::array<std::byte, 256> buffer{};
  const auto number_of_first = [&](std::uint32_t drawn) {
    ClientChannel channel({.client_epoch = 1, .handshake_number = drawn}, buffer);
    const MonotonicTime now = time_from_ns(1'000'000'000);
    return decode_frame(channel.open(0, now + std::chrono::seconds{1}, now))->call_id;
  };
  EXPECT_EQ(number_of_first(4711), 4712u);
  EXPECT_EQ(number_of_first(0xffff'ffff), 0u);
}

TEST_F(ClientHandshakeOnAStream, AcceptsNoCookies) {
  const Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
  EXPECT_EQ(channel_.on_frame(cookie_frame(hello, std::byte{7}), at(0s)).kind, Kind::kNothing);
  EXPECT_EQ(dropped(DropReason::kUnexpected), 1u);
  EXPECT_EQ(channel_.on_frame(welcome_frame(hello, welcome()), at(0s)).kind, Kind::kReady);
}

}  // namespace
}  // namespace rtpm::wire
