#include <gtest/gtest.h>

#include "client_fixture.hpp"
#include "peers.hpp"

// Both kinds of oneways, on both sides: spec/hprotocol.md#hp-5.8.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;
using Action = Verdict::Action;

class ServerOneways : public testing::Test {
 protected:
  void SetUp() override { peer_.open(server_, at(0s)); }

  Verdict receive(const Bytes& frame, MonotonicTime now = at(0s)) {
    return server_.on_frame(frame, peer_.address, now);
  }
  Bytes oneway(std::uint32_t call_id, std::uint16_t flags, std::uint32_t budget_us = 1'000'000) {
    Header header = peer_.call_header(call_id);
    header.flags = flags;
    header.budget_us = budget_us;
    return frame_of(header, bytes_of("oneway"));
  }
  ServerSessions server_{server_config()};
  Peer peer_;
};

// hp-5.2-4
TEST_F(ServerOneways, ReleaseTheirSlotAtOnce) {
  const Verdict oneway_call = receive(oneway(1, kFlagNoReply));
  ASSERT_EQ(oneway_call.action, Action::kDispatch);
  const Verdict next = receive(peer_.call_frame(1 + kCallWindow, "next"));
  ASSERT_EQ(next.action, Action::kDispatch) << "its client can't know whether the oneway runs";
  const Bytes late = answer(server_, oneway_call.request, "late", at(1ms));
  EXPECT_TRUE(late.empty());
  EXPECT_EQ(server_.counters().orphaned_count, 1u) << "its slot belongs to another call";
  EXPECT_EQ(payload_of(answer(server_, next.request, "own", at(2ms))), bytes_of("own"));
  EXPECT_EQ(payload_of(receive(peer_.call_frame(1 + kCallWindow, "next")).frame), bytes_of("own"));
}

// hp-5.8-3, hp-5.2-4
TEST_F(ServerOneways, WithReceiptReleaseTheirSlotOnceAnswered) {
  const Verdict first = receive(oneway(1, kFlagReplyOnReceipt));
  EXPECT_EQ(header_of(receive(peer_.call_frame(1 + kCallWindow)).frame).status, Status::kOverload)
      << "its client still waits";
  static_cast<void>(server_.accept(first.request, Status::kOk, at(0s)));
  const Verdict next = receive(peer_.call_frame(1 + 2 * kCallWindow));
  EXPECT_EQ(next.action, Action::kDispatch);
  EXPECT_TRUE(answer(server_, first.request, "", at(1ms)).empty());
}

class ClientOneways : public ClientChannelTest {
 protected:
  void SetUp() override { make_ready(at(0s)); }

  CallParameters oneway(Delivery delivery) {
    CallParameters oneway = parameters(at(1s));
    oneway.delivery = delivery;
    return oneway;
  }
};

// hp-5.8-2
TEST_F(ClientOneways, WithoutReplyFitOneFrame) {
  const Bytes fits(kDatagramPayloadSizeMax);
  const Bytes large(kDatagramPayloadSizeMax + 1);
  const auto frame = channel_.call(oneway(Delivery::kSent), large, at(0s));
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error(), Status::kTooLarge);
  EXPECT_TRUE(channel_.call(oneway(Delivery::kSent), fits, at(0s)));
}

// hp-5.5-2: the client cannot know whether a oneway ran; the next call makes a handshake.
TEST_F(ClientOneways, OfAnUnknownSessionEndOnlyTheSession) {
  const Bytes frame = copy_of(*channel_.call(oneway(Delivery::kSent), request_, at(0s)));
  EXPECT_EQ(channel_.on_frame(refuse_frame(frame, Status::kUnknownSession), at(1ms)).kind,
            Kind::kNothing);
  EXPECT_FALSE(channel_.is_ready());
}

// hp-5.8: each fragment of a large request, repeated or not, has the flag *reply on receipt*.
TEST_F(ClientOneways, WithReceiptSetTheFlagInEachFragment) {
  const Bytes large(1500);
  const auto first = channel_.call(oneway(Delivery::kReceipt), large, at(0s));
  ASSERT_TRUE(first);
  EXPECT_EQ(header_of(*first).flags & kFlagReplyOnReceipt, kFlagReplyOnReceipt);
  const ConstBytes second = channel_.next_frame(at(0s));
  EXPECT_EQ(header_of(second).flags, kFlagReplyOnReceipt | kFlagAckWanted);
  const ChannelEvent copy = channel_.on_time(channel_.next_time());
  ASSERT_EQ(copy.kind, Kind::kSend);
  EXPECT_EQ(header_of(copy.frame).flags, kFlagReplyOnReceipt | kFlagAckWanted | kFlagRepeated);
}

}  // namespace
}  // namespace rtpm::wire
