#include <gtest/gtest.h>

#include "client_fixture.hpp"
#include "peers.hpp"

// Cancelled calls: spec/hprotocol.md#hp-5.9.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;
using Action = Verdict::Action;

class ServerCancel : public testing::Test {
 protected:
  void SetUp() override { peer_.open(server_, at(0s)); }

  Verdict receive(const Bytes& frame, MonotonicTime now = at(0s)) {
    return server_.on_frame(frame, peer_.address, now);
  }
  Verdict call(std::uint32_t call_id) { return receive(peer_.call_frame(call_id, "request")); }
  Bytes cancel_frame(std::uint32_t call_id, std::string_view payload = "") {
    Header header = peer_.call_header(call_id);
    header.kind = FrameKind::kCancel;
    header.budget_us = 0;
    return frame_of(header, bytes_of(payload));
  }

  ServerSessions server_{server_config()};
  Peer peer_;
};

// hp-5.9-2: a running method is notified, and ends at will; the server sends no REPLY.
TEST_F(ServerCancel, NotifiesARunningCall) {
  const Verdict verdict = call(1);
  ASSERT_EQ(verdict.action, Action::kDispatch);
  server_.set_tag(verdict.request, 7);
  EXPECT_EQ(server_.next_cancelled(), 0u);
  EXPECT_EQ(receive(cancel_frame(1)).action, Action::kNothing);
  EXPECT_EQ(server_.next_cancelled(), 7u);
  EXPECT_EQ(server_.next_cancelled(), 0u) << "once";
  EXPECT_EQ(server_.counters().cancelled_count, 1u);
  EXPECT_EQ(receive(cancel_frame(1)).action, Action::kNothing) << "a copy";
  EXPECT_EQ(server_.next_cancelled(), 0u);
  EXPECT_EQ(call(1).action, Action::kNothing) << "a copy of the call is not run again";
  EXPECT_TRUE(answer(server_, verdict.request, "done", at(1s), Status::kCancelled).empty());
  EXPECT_EQ(call(1).action, Action::kNothing) << "nor when it ended";
}

// hp-5.9-2: an older call may still hold the slot.
TEST_F(ServerCancel, AppliesToALaterCallWhileAnOlderOneRuns) {
  const Verdict older = call(1);
  EXPECT_EQ(receive(cancel_frame(1 + kCallWindow)).action, Action::kNothing);
  EXPECT_EQ(payload_of(answer(server_, older.request, "older", at(1ms))), bytes_of("older"))
      << "the older one is not the one that was cancelled";
  EXPECT_NE(call(1 + kCallWindow).action, Action::kDispatch);
  EXPECT_EQ(call(1 + 2 * kCallWindow).action, Action::kDispatch);
}

// hp-5.9-2: a request of which only half has arrived does not run when the rest arrives.
TEST(ServerCancelOfALargeCall, ReleasesItsFragments) {
  Bytes large(3 * 8192);
  ServerSessionsConfig config = server_config();
  config.message_size_max = 8192;
  config.large_memory = large;
  ServerSessions server(config);
  Peer peer;
  peer.open(server, at(0s));
  const auto fragment = [&](std::uint32_t call_id, std::uint16_t index) {
    Header header = peer.call_header(call_id);
    header.fragment_index = index;
    header.fragment_count = 2;
    header.message_size = 2000;
    header.payload_size = 1000;
    Bytes frame(kHeaderSize + 1000);
    encode(header, frame.data());
    return server.on_frame(frame, peer.address, at(0s));
  };
  EXPECT_EQ(fragment(1, 0).action, Action::kNothing);
  Header cancel = peer.call_header(1);
  cancel.kind = FrameKind::kCancel;
  EXPECT_EQ(server.on_frame(frame_of(cancel), peer.address, at(0s)).action, Action::kNothing);
  EXPECT_EQ(server.counters().cancelled_count, 1u);
  EXPECT_EQ(fragment(1, 1).action, Action::kNothing);
  EXPECT_EQ(fragment(1, 0).action, Action::kNothing);
  EXPECT_EQ(server.counters().dropped_for(DropReason::kStaleCall), 2u);
  // The buffer is free again: two large requests fit at a time.
  for (const std::uint32_t call_id : {2u, 3u}) {
    EXPECT_EQ(fragment(call_id, 0).action, Action::kNothing);
  }
  for (const std::uint32_t call_id : {2u, 3u}) {
    EXPECT_EQ(fragment(call_id, 1).action, Action::kDispatch);
  }
}

class ClientCancel : public ClientChannelTest {
 protected:
  void SetUp() override { make_ready(at(0s)); }
};

// hp-5.9: the client's call ends at once; spec/vectors has the bytes of CANCEL.
TEST_F(ClientCancel, EndsTheCallAtOnce) {
  const Bytes call = begin_call(at(0s));
  const CallIndex index = channel_.last_call();
  EXPECT_EQ(header_of(channel_.cancel(index, at(1ms))).kind, FrameKind::kCancel);
  EXPECT_FALSE(channel_.is_open(index));
  EXPECT_TRUE(channel_.has_free_call());
  EXPECT_EQ(channel_.next_time(), kNever) << "neither call nor CANCEL is repeated";
  EXPECT_EQ(channel_.on_frame(reply_frame(call, "late"), at(2ms)).kind, Kind::kNothing);
  EXPECT_TRUE(channel_.cancel(index, at(3ms)).empty()) << "there is no call";
}

// hp-5.3-2: the call was repeated, in fragments, too; CANCEL is a bare header.
TEST_F(ClientCancel, SendsABareHeaderForALargeCall) {
  const Bytes large(1500);
  ASSERT_TRUE(channel_.call(parameters(at(1s)), large, at(0s)));
  const Bytes frame = copy_of(channel_.cancel(channel_.last_call(), at(1ms)));
  EXPECT_EQ(frame.size(), kHeaderSize);
  EXPECT_EQ(header_of(frame).fragment_count, 1u);
  EXPECT_TRUE(channel_.next_frame(at(1ms)).empty()) << "no more fragments";
}

}  // namespace
}  // namespace rtpm::wire
