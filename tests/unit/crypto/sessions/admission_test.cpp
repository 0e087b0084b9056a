#include <gtest/gtest.h>

#include <algorithm>

#include "peers.hpp"

// The effect of a server's grants on its sessions.
namespace rtpm::sealed::test {
namespace {

using namespace std::chrono_literals;
using Kind = wire::ChannelEvent::Kind;

constexpr MonotonicTime kNow = MonotonicTime{} + 1000s;

// sec-6.2-1: the server's grants for unnamed clients.
TEST(SealedSessions, AreRefusedToUnnamedClientsWithoutAGrantForAll) {
  Server server(wire::Medium::kDatagram, 3, /*takes_unsealed=*/true);
  server.door.is_open_for_all = false;
  std::array<std::byte, wire::kDatagramFrameSizeMax> buffer{};
  wire::ClientChannel channel({.client_epoch = 9, .channel = 2}, buffer);
  const Bytes hello = copy_of(channel.open(kPriority, kNever, kNow));
  const auto answers = server.receive(hello, kNow);
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(header_of(answers[0]).kind, FrameKind::kRefuse);
  EXPECT_EQ(header_of(answers[0]).status, wire::Status::kNotAllowed);
  std::size_t answer_count = 0;
  for (int i = 0; i < 1000; ++i)
    answer_count += server.receive(hello, kNow).size();
  EXPECT_LT(answer_count, 300u);
  EXPECT_GT(server.sealed->counters().dropped_for(DropReason::kRateLimited), 500u);
}

TEST(SealedSessions, HaveAPriorityWithinTheirGrants) {
  Server server(wire::Medium::kDatagram, 3, /*takes_unsealed=*/true);
  server.door.ceiling_of_keys = Priority{2000};
  server.door.ceiling_of_all = Priority{1500};
  Client client(server.identity.key.public_key);
  client.open(kNow);
  talk(client, server, kNow);
  ASSERT_TRUE(client.channel.is_ready());
  EXPECT_EQ(client.channel.welcome().ceiling, Priority{2000});
  std::array<std::byte, wire::kDatagramFrameSizeMax> buffer{};
  wire::ClientChannel plain({.client_epoch = 9, .channel = 2}, buffer);
  const auto cookie = server.receive(copy_of(plain.open(kPriority, kNever, kNow)), kNow);
  ASSERT_EQ(cookie.size(), 1u);
  const auto hello = copy_of(plain.on_frame(cookie[0], kNow).frame);
  static_cast<void>(plain.on_frame(server.receive(hello, kNow)[0], kNow));
  ASSERT_TRUE(plain.is_ready());
  EXPECT_EQ(plain.welcome().ceiling, Priority{1500});
}

// hp-4.5-2: an unforgeable frame tells a client at once that its session was closed.
TEST(SealedSessions, AreClosedUnderTheirKeysWhenTheirGrantIsRevoked) {
  Server server(wire::Medium::kDatagram, 3, /*takes_unsealed=*/true);
  Client client(server.identity.key.public_key);
  open_and_call(client, server, kNow);
  client.events.clear();
  server.door.is_open = server.door.is_open_for_all = false;
  const auto index = static_cast<std::uint32_t>(client.channel.session() & 0xffff);
  const auto close = server.sealed->review(index, kNow);
  ASSERT_TRUE(close);
  EXPECT_EQ(close->peer, kClientAddress);
  EXPECT_TRUE(wire::is_sealed(close->frame));
  client.receive(copy_of(close->frame), kNow);
  ASSERT_FALSE(client.events.empty());
  EXPECT_EQ(client.events.back(), Kind::kClosed);
  EXPECT_EQ(server.sessions->session_count(), 0u);
  EXPECT_FALSE(server.sealed->review(index, kNow));
}

TEST(SealedSessions, OpenOnceAHandshakeIsAdmitted) {
  Server server;
  Client client(server.identity.key.public_key);
  server.door.has_time = false;
  client.open(kNow);
  talk(client, server, kNow);
  EXPECT_EQ(server.job_count, 0);
  EXPECT_FALSE(client.channel.is_ready());
  server.door.has_time = true;
  client.on_time(kNow + 100ms);
  talk(client, server, kNow + 100ms);
  EXPECT_TRUE(client.channel.is_ready());
}

// sec-5-2: the memory of keys is zeros, as in a forked child.
TEST(SealedSessions, AreSilentAtAServerWithWipedKeys) {
  Server server(wire::Medium::kDatagram, 3, /*takes_unsealed=*/true);
  Client client(server.identity.key.public_key);
  open_and_call(client, server, kNow);
  client.call("two", kNow);
  std::ranges::fill(std::as_writable_bytes(std::span(server.memory)), std::byte{0});
  wire::Header header;
  header.kind = FrameKind::kReply;
  header.session = client.channel.session();
  std::array<std::byte, wire::kHeaderSize> reply;
  wire::encode(header, reply.data());
  EXPECT_TRUE(server.sealed->seal(reply).empty());
  EXPECT_TRUE(server.receive(client.sent.front(), kNow).empty());
  EXPECT_EQ(server.run_count, 1);
  Client stranger(server.identity.key.public_key);
  stranger.open(kNow);
  EXPECT_TRUE(server.receive(stranger.sent.front(), kNow).empty());
}

// A server of sealed sessions only must not send a frame unsealed, either.
TEST(SealedSessions, NeverSendAnUnsealedFrameOfASession) {
  Server server;
  wire::Header header;
  header.kind = FrameKind::kReply;
  header.session = 0x1234500000003;
  std::array<std::byte, wire::kHeaderSize> frame;
  wire::encode(header, frame.data());
  EXPECT_TRUE(server.sealed->seal(frame).empty());
  header.kind = FrameKind::kRefuse;
  wire::encode(header, frame.data());
  EXPECT_FALSE(server.sealed->seal(frame).empty());
}

}  // namespace
}  // namespace rtpm::sealed::test
