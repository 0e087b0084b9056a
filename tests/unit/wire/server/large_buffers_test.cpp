#include <algorithm>
#include <memory>
#include <vector>

#include "peers.hpp"

// The holders of the buffers for large messages, and how long they may keep them.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;
using Action = Verdict::Action;

constexpr std::uint32_t kLarge = 8 * 1024;
/// Longer than any silence, so that the caller's deadline does not end a message.
constexpr std::uint32_t kForEver = 0xffff'ffff;

class LargeBuffers : public testing::Test {
 protected:
  /// A server with `buffer_count` buffers, besides the one in which replies are written.
  void serve(std::size_t buffer_count, Medium medium = Medium::kDatagram) {
    memory_.resize((buffer_count + 1) * kLarge);
    medium_ = medium;
    ServerSessionsConfig config = server_config(medium);
    config.message_size_max = kLarge;
    config.large_memory = memory_;
    config.session_count_max = 32;
    config.frame_payload_max = kDatagramPayloadSizeMax;
    server_ = std::make_unique<ServerSessions>(config);
  }
  /// A client on the host with that number.
  Peer peer_of(std::uint64_t host) {
    Peer peer;
    peer.address = {.low = host, .port = ++port_};
    peer.open(*server_, at(0s), medium_);
    return peer;
  }
  Verdict fragment(const Peer& peer, std::uint32_t call_id, std::uint16_t index,
                   MonotonicTime now) {
    Header header = peer.call_header(call_id);
    header.budget_us = kForEver;
    header.fragment_index = index;
    header.fragment_count = 3;
    header.message_size = 3 * 1000;
    header.payload_size = 1000;
    header.flags = kFlagAckWanted;
    Bytes frame(kHeaderSize + 1000);
    encode(header, frame.data());
    return server_->on_frame(frame, peer.address, now);
  }
  /// Whether the server accepts a new large request.
  bool takes(const Peer& peer, std::uint32_t call_id, MonotonicTime now) {
    const Header answer = header_of(fragment(peer, call_id, 0, now).frame);
    EXPECT_TRUE(answer.kind == FrameKind::kAck || answer.status == Status::kOverload);
    return answer.kind == FrameKind::kAck;
  }
  /// Runs a small call; its reply will be large.
  Request small_call(const Peer& peer, std::uint32_t call_id, MonotonicTime now) {
    Header header = peer.call_header(call_id);
    header.budget_us = kForEver;
    const Verdict verdict = server_->on_frame(frame_of(header), peer.address, now);
    EXPECT_EQ(verdict.action, Action::kDispatch);
    return verdict.request;
  }
  void reply_large(const Request& request, MonotonicTime now) {
    ASSERT_EQ(server_->reply_buffer(request, now).size(), kLarge);
    EXPECT_FALSE(server_->complete(request, Status::kOk, kLarge, now).empty());
    while (!server_->next_frame(now).empty()) {
    }
  }
  Verdict acknowledge(const Peer& peer, std::uint32_t call_id, std::uint16_t first_missing,
                      MonotonicTime now) {
    Bytes payload(FragmentAck::kSize);
    encode(FragmentAck{.first_missing = first_missing}, payload);
    return server_->on_frame(
        frame_of(header_about(peer.call_header(call_id), FrameKind::kAck, FragmentAck::kSize, now),
                 payload),
        peer.address, now);
  }

  Bytes memory_;
  Medium medium_ = Medium::kDatagram;
  std::unique_ptr<ServerSessions> server_;
  std::uint32_t port_ = 0;
};

// hp-5.6-10: a sender's unfinished message does not keep others out until its deadline.
TEST_F(LargeBuffers, AreReclaimedFromSilentRequests) {
  serve(2);
  const Peer silent = peer_of(1);
  const Peer other = peer_of(2);
  EXPECT_TRUE(takes(silent, 1, at(0s)));
  EXPECT_TRUE(takes(silent, 2, at(1s)));
  EXPECT_EQ(server_->large_message_count(at(2s)), 2u);
  EXPECT_FALSE(takes(other, 1, at(kLargeMessageSilenceMax - 1ns)));
  EXPECT_TRUE(takes(other, 2, at(kLargeMessageSilenceMax)));
  EXPECT_EQ(server_->large_message_count(at(kLargeMessageSilenceMax)), 2u);
  EXPECT_EQ(server_->counters().large_evicted_count, 1u);
  // hp-5.6-10, hp-5.1-5: the sender may be alive after all, and may send it again.
  const Verdict late = fragment(silent, 1, 1, at(5s));
  ASSERT_EQ(late.action, Action::kSend);
  EXPECT_EQ(header_of(late.frame).kind, FrameKind::kRefuse);
  EXPECT_EQ(header_of(late.frame).status, Status::kOverload);
  for (std::uint16_t index = 0; index < 3; ++index) {
    EXPECT_EQ(fragment(silent, 1, index, at(6s)).action, Action::kSend) << "it never runs";
  }
}

// hp-5.6-10, hp-5.3-3: repetitions are at most 1 s apart, so that a network that loses two in a
// row, or every ACK, costs no message.
TEST_F(LargeBuffers, StayWithASenderThatRepeats) {
  serve(2);
  const Peer slow = peer_of(1);
  const Peer other = peer_of(2);
  EXPECT_TRUE(takes(slow, 1, at(0s)));
  EXPECT_TRUE(takes(slow, 2, at(0s)));
  for (int round = 1; round <= 100; ++round) {
    const MonotonicTime now = at(round * (kLargeMessageSilenceMax - 1ms));
    EXPECT_FALSE(takes(other, static_cast<std::uint32_t>(round), now));
    static_cast<void>(fragment(slow, 1, 0, now));
    static_cast<void>(fragment(slow, 2, 0, now));
  }
  const MonotonicTime end = at(101 * (kLargeMessageSilenceMax - 1ms));
  EXPECT_EQ(fragment(slow, 1, 1, end).action, Action::kSend);
  EXPECT_EQ(fragment(slow, 1, 2, end).action, Action::kDispatch);
}

// hp-5.6-10
TEST_F(LargeBuffers, AreReclaimedFromTheLongestSilentMessage) {
  serve(3);
  const Peer silent = peer_of(1);
  const Peer other = peer_of(2);
  EXPECT_TRUE(takes(silent, 1, at(20ms)));
  EXPECT_TRUE(takes(silent, 2, at(10ms)));
  EXPECT_TRUE(takes(silent, 3, at(30ms)));
  EXPECT_TRUE(takes(other, 1, at(10s)));
  EXPECT_EQ(header_of(fragment(silent, 1, 0, at(10s)).frame).kind, FrameKind::kAck);
  EXPECT_EQ(header_of(fragment(silent, 3, 0, at(10s)).frame).kind, FrameKind::kAck);
  EXPECT_EQ(header_of(fragment(silent, 2, 0, at(10s)).frame).kind, FrameKind::kRefuse);
}

// hp-5.6-10: replies that their callers do not fetch do not keep others out, either.
TEST_F(LargeBuffers, AreReclaimedFromUnfetchedReplies) {
  serve(2);
  const Peer silent = peer_of(1);
  const Peer fetching = peer_of(2);
  reply_large(small_call(silent, 1, at(0s)), at(0s));
  reply_large(small_call(fetching, 1, at(0s)), at(0s));
  // The server holds two replies; a third gets no large buffer, and its caller gets one frame.
  const Request third = small_call(fetching, 2, at(1s));
  EXPECT_TRUE(server_->is_short_of_buffers(third, at(1s)));
  EXPECT_EQ(server_->reply_buffer(third, at(1s)).size(), kDatagramPayloadSizeMax);
  EXPECT_EQ(server_->next_buffer_time(at(1s)), at(kLargeMessageSilenceMax));
  // ACKs, and repetitions of the call, show that the caller is alive.
  EXPECT_EQ(acknowledge(fetching, 1, 1, at(2s)).action, Action::kNothing);
  EXPECT_FALSE(server_->is_short_of_buffers(third, at(kLargeMessageSilenceMax)));
  reply_large(third, at(kLargeMessageSilenceMax));
  EXPECT_EQ(acknowledge(silent, 1, 1, at(4s)).action, Action::kNothing);
  EXPECT_EQ(server_->counters().dropped_for(DropReason::kUnexpected), 1u) << "it was evicted";
  EXPECT_EQ(acknowledge(fetching, 1, 7, at(4s)).action, Action::kNothing);
  EXPECT_TRUE(server_->has_freed_buffer());
  EXPECT_FALSE(server_->has_freed_buffer());
  EXPECT_EQ(server_->large_message_count(at(4s)), 1u);
}

// hp-5.6-11: one host may have three quarters at most, also over connections.
TEST_F(LargeBuffers, AreSharedAmongHosts) {
  for (const Medium medium : {Medium::kDatagram, Medium::kStream}) {
    serve(8, medium);
    for (std::uint32_t number = 0; number < 6; ++number)
      EXPECT_TRUE(takes(peer_of(1), 1, at(0s))) << number;
    EXPECT_FALSE(takes(peer_of(1), 1, at(0s)));
    EXPECT_TRUE(takes(peer_of(2), 1, at(0s)));
    EXPECT_TRUE(takes(peer_of(3), 1, at(0s)));
    EXPECT_FALSE(takes(peer_of(3), 1, at(1s))) << "all are taken";
    // The silence of other hosts does not give the first one more than its share.
    const Peer first = peer_of(1);
    EXPECT_TRUE(takes(first, 1, at(10s)));
    EXPECT_EQ(server_->counters().large_evicted_count, 1u);
    EXPECT_TRUE(takes(peer_of(2), 1, at(10s)));
  }
}

// However many buffers are taken, a request passes its own buffer on to its reply.
TEST_F(LargeBuffers, AreReusedForTheReplyToALargeRequest) {
  serve(2);
  const Peer peer = peer_of(1);
  EXPECT_TRUE(takes(peer, 1, at(0s)));
  EXPECT_TRUE(takes(peer, 2, at(0s)));
  for (std::uint32_t call_id = 1; call_id <= 2; ++call_id) {
    EXPECT_EQ(fragment(peer, call_id, 1, at(0s)).action, Action::kSend);
    const Verdict whole = fragment(peer, call_id, 2, at(0s));
    ASSERT_EQ(whole.action, Action::kDispatch);
    EXPECT_FALSE(server_->is_short_of_buffers(whole.request, at(0s)));
    reply_large(whole.request, at(0s));
  }
}

// A small reply needs no large buffer, and a reply without a waiting caller is not kept.
TEST_F(LargeBuffers, AreNotNeededBySmallReplies) {
  serve(2);
  const Peer peer = peer_of(1);
  EXPECT_TRUE(takes(peer, 1, at(0s)));
  EXPECT_TRUE(takes(peer, 2, at(0s)));
  const Request small = small_call(peer, 3, at(0s));
  EXPECT_EQ(payload_of(answer(*server_, small, "small", at(0s))), bytes_of("small"));
  Header oneway = peer.call_header(4);
  oneway.flags = kFlagNoReply;
  const Verdict verdict = server_->on_frame(frame_of(oneway), peer.address, at(0s));
  ASSERT_EQ(verdict.action, Action::kDispatch);
  EXPECT_FALSE(server_->is_short_of_buffers(verdict.request, at(0s)));
}

}  // namespace
}  // namespace rtpm::wire
