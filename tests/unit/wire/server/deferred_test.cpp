#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "peers.hpp"

// Calls that end late and in any order, and servers that stop: spec/hprotocol.md#hp-5.1, #hp-4.5.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;
using Action = Verdict::Action;

constexpr std::uint32_t kLarge = 16 * 1024;

class Deferred : public testing::Test {
 protected:
  explicit Deferred(Medium medium = Medium::kDatagram)
      : large_(4 * kLarge), medium_(medium), server_(config(medium)) {}
  void SetUp() override { peer_.open(server_, at(0s), medium_); }

  ServerSessionsConfig config(Medium medium) {
    ServerSessionsConfig config = server_config(medium);
    config.message_size_max = kLarge;
    config.large_memory = large_;
    return config;
  }
  Request run(std::uint32_t call_id, MonotonicTime now = at(0s)) {
    const Verdict verdict = server_.on_frame(peer_.call_frame(call_id), peer_.address, now);
    EXPECT_EQ(verdict.action, Action::kDispatch);
    return verdict.request;
  }
  void receive(const Header& header, MonotonicTime now = at(0s)) {
    EXPECT_EQ(server_.on_frame(frame_of(header), peer_.address, now).action, Action::kNothing);
  }
  Header close_header() const {
    Header close;
    close.kind = FrameKind::kClose;
    close.session = peer_.session;
    return close;
  }

  Bytes large_;
  Medium medium_;
  ServerSessions server_;
  Peer peer_;
};

class DeferredOnAStream : public Deferred {
 protected:
  DeferredOnAStream() : Deferred(Medium::kStream) {}
};

// An orphan's reply has no recipient, least of all the client that has the session's slot now.
TEST_F(Deferred, AreOrphansOnceTheirSessionIsClosed) {
  const Request request = run(1);
  server_.set_tag(request, 3);
  receive(close_header());
  EXPECT_EQ(server_.next_cancelled(), 3u) << "the caller no longer waits";
  EXPECT_EQ(server_.next_cancelled(), 0u);
  EXPECT_EQ(server_.peer_of(request), std::nullopt);

  Peer other;
  other.channel = 2;
  other.open(server_, at(1ms));
  const Verdict theirs = server_.on_frame(other.call_frame(1), other.address, at(1ms));
  ASSERT_EQ(theirs.action, Action::kDispatch);
  EXPECT_EQ(theirs.request.session_index, request.session_index) << "the slot is reused";

  const MutableBytes buffer = server_.reply_buffer(request, at(0s));
  EXPECT_GE(buffer.size(), kDatagramPayloadSizeMax) << "a servant need not know";
  EXPECT_EQ(server_.item_size_max(request), 0u);
  EXPECT_TRUE(answer(server_, request, "for nobody", at(2ms)).empty());
  EXPECT_EQ(server_.counters().orphaned_count, 1u);
  EXPECT_EQ(payload_of(answer(server_, theirs.request, "theirs", at(3ms))), bytes_of("theirs"));
}

TEST_F(Deferred, AreOrphansOnceTheirSessionIsReplaced) {
  ServerSessionsConfig config = server_config();
  config.session_count_max = 1;
  ServerSessions server(config);
  Peer former;
  former.open(server, at(0s));
  const Verdict verdict = server.on_frame(former.call_frame(1), former.address, at(0s));
  server.set_tag(verdict.request, 9);
  Peer next;
  next.channel = 2;
  next.open(server, at(kSessionIdleMin));
  EXPECT_EQ(server.counters().session_evicted_count, 1u);
  EXPECT_EQ(server.next_cancelled(), 9u);
  EXPECT_TRUE(answer(server, verdict.request, "late", at(kSessionIdleMin)).empty());
  EXPECT_EQ(server.counters().orphaned_count, 1u);
}

TEST_F(DeferredOnAStream, AreOrphansOnceTheirConnectionEnds) {
  const Request request = run(1);
  server_.set_tag(request, 9);
  server_.end_connection(peer_.address);
  EXPECT_EQ(server_.next_cancelled(), 9u);
  EXPECT_EQ(server_.peer_of(request), std::nullopt);
  EXPECT_TRUE(answer(server_, request, "late", at(1ms)).empty());
}

// A reply that is not sent must not overwrite one that is kept.
TEST_F(Deferred, KeepTheReplyThatHasTheirSlot) {
  Header oneway = peer_.call_header(1);
  oneway.flags = kFlagNoReply;
  const Verdict old = server_.on_frame(frame_of(oneway), peer_.address, at(0s));
  ASSERT_EQ(old.action, Action::kDispatch);
  const Request next = run(1 + kCallWindow);
  static_cast<void>(answer(server_, next, "kept", at(1ms)));
  EXPECT_TRUE(answer(server_, old.request, "XXXXXXXX", at(2ms)).empty());
  const Verdict copy = server_.on_frame(peer_.call_frame(1 + kCallWindow), peer_.address, at(3ms));
  EXPECT_EQ(payload_of(copy.frame), bytes_of("kept"));
}

// Each of several large replies has its own buffer until it has arrived.
TEST_F(Deferred, EndWithLargeReplies) {
  std::vector<Request> requests{run(1), run(2), run(3)};
  std::vector<Header> first_frames;
  for (std::size_t i = 0; i < 2; ++i) {
    const MutableBytes buffer = server_.reply_buffer(requests[i], at(0s));
    ASSERT_EQ(buffer.size(), kLarge);
    std::ranges::fill(buffer.first(3000), static_cast<std::byte>(i + 1));
    const ConstBytes frame = server_.complete(requests[i], Status::kOk, 3000, at(1ms));
    ASSERT_EQ(frame.size(), kDatagramFrameSizeMax);
    EXPECT_EQ(frame[kHeaderSize], static_cast<std::byte>(i + 1));
    int more_count = 0;
    while (!server_.next_frame(at(1ms)).empty())
      ++more_count;
    EXPECT_EQ(more_count, 2);
  }
  // A duplicate of the first call fetches its reply, not the other's.
  const Verdict copy = server_.on_frame(peer_.call_frame(1), peer_.address, at(2ms));
  ASSERT_EQ(copy.action, Action::kSend);
  EXPECT_EQ(header_of(copy.frame).call_id, 1u);
  EXPECT_EQ(copy.frame[kHeaderSize], std::byte{1});
}

// After the deadline a large reply has no reader: its buffer may go to the next one at once.
TEST_F(Deferred, ReleaseTheirLargeReplyAfterTheirDeadline) {
  const Request request = run(1);
  for (int round = 0; round < 10; ++round) {
    const Request late = run(static_cast<std::uint32_t>(10 + kCallWindow * round));
    const MutableBytes buffer = server_.reply_buffer(late, at(10s));
    ASSERT_EQ(buffer.size(), kLarge);
    static_cast<void>(server_.complete(late, Status::kOk, 3000, at(10s)));
    while (!server_.next_frame(at(10s)).empty()) {
    }
  }
  const MutableBytes buffer = server_.reply_buffer(request, at(10s));
  std::ranges::fill(buffer.first(3000), std::byte{7});
  static_cast<void>(server_.complete(request, Status::kOk, 3000, at(10s)));
}

TEST_F(Deferred, ReportTheirCancellationOnceEach) {
  for (std::uint32_t call_id = 1; call_id <= kCallWindow; ++call_id)
    server_.set_tag(run(call_id), 100 + call_id);
  receive(close_header());
  std::vector<std::uint32_t> cancelled;
  for (std::uint32_t tag = server_.next_cancelled(); tag != 0; tag = server_.next_cancelled())
    cancelled.push_back(tag);
  std::ranges::sort(cancelled);
  EXPECT_EQ(cancelled, (std::vector<std::uint32_t>{101, 102, 103, 104, 105, 106, 107, 108}));
}

// hp-4.5-2: each session gets its CLOSE; then there is no session.
TEST(ServerStop, ClosesEverySession) {
  ServerSessionsConfig config = server_config();
  config.band = {50, 200};
  ServerSessions server(config);
  std::vector<Peer> peers(3);
  for (std::uint32_t i = 0; i < 3; ++i) {
    peers[i].channel = i + 1;
    peers[i].address.port = 5000 + i;
    peers[i].open(server, at(0s));
  }
  const Verdict running = server.on_frame(peers[1].call_frame(1), peers[1].address, at(0s));
  server.set_tag(running.request, 4);
  std::vector<std::uint64_t> closed;
  while (const auto outgoing = server.close_next(at(1s))) {
    const Header header = header_of(outgoing->frame);
    EXPECT_EQ(header.kind, FrameKind::kClose);
    EXPECT_EQ(header.payload_size, 0u) << "hp-4.5-3";
    EXPECT_TRUE(config.band.contains(header.priority)) << "it reaches the session's lane";
    const auto peer = std::ranges::find(peers, header.session, &Peer::session);
    ASSERT_NE(peer, peers.end());
    EXPECT_EQ(outgoing->peer, peer->address);
    closed.push_back(header.session);
    ASSERT_LE(closed.size(), 3u);
  }
  EXPECT_EQ(closed.size(), 3u);
  EXPECT_EQ(server.session_count(), 0u);
  EXPECT_EQ(server.next_cancelled(), 4u);
  EXPECT_TRUE(answer(server, running.request, "late", at(2s)).empty());
  const Verdict next = server.on_frame(peers[0].call_frame(2), peers[0].address, at(2s));
  EXPECT_EQ(header_of(next.frame).status, Status::kUnknownSession);
}

}  // namespace
}  // namespace rtpm::wire
