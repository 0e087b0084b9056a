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
  std::uint64_t dropped(DropReason reason) const { return server_.counters().dropped_for(reason); }

  ServerSessions server_{server_config()};
  Peer peer_;
};

// hp-5.8-1
TEST_F(ServerOneways, WithoutReplyRunAndAreNotAnswered) {
  const Bytes frame = oneway(1, kFlagNoReply);
  const Verdict verdict = receive(frame);
  ASSERT_EQ(verdict.action, Action::kDispatch);
  EXPECT_EQ(copy_of(verdict.request.payload), bytes_of("oneway"));
  EXPECT_FALSE(verdict.request.wants_receipt());
  EXPECT_TRUE(answer(server_, verdict.request, "nobody reads this", at(1ms)).empty());
  EXPECT_EQ(server_.counters().orphaned_count, 0u) << "it ended as it should";
}

// hp-5.8-1, hp-5.2-1: the server sends nothing, whatever the result.
TEST_F(ServerOneways, WithoutReplyAreNeverAnswered) {
  EXPECT_EQ(receive(oneway(1, kFlagNoReply, 0)).action, Action::kNothing) << "expired";
  EXPECT_EQ(server_.counters().expired_count, 1u);

  const Verdict verdict = receive(oneway(2, kFlagNoReply));
  ASSERT_EQ(verdict.action, Action::kDispatch);
  const std::uint16_t asking = kFlagNoReply | kFlagRepeated | kFlagAckWanted;
  EXPECT_EQ(receive(oneway(2, asking)).action, Action::kNothing) << "a copy while it runs";
  EXPECT_EQ(dropped(DropReason::kDuplicateRunning), 1u);
  static_cast<void>(answer(server_, verdict.request, "", at(1ms)));
  EXPECT_EQ(receive(oneway(2, asking)).action, Action::kNothing) << "a copy of one that ran";
  EXPECT_EQ(dropped(DropReason::kStaleCall), 1u);

  const Verdict two_way = receive(peer_.call_frame(3));
  ASSERT_EQ(two_way.action, Action::kDispatch);
  EXPECT_EQ(receive(oneway(3 + kCallWindow, kFlagNoReply)).action, Action::kNothing)
      << "its place is taken";
  EXPECT_EQ(server_.counters().refused_count, 1u);
  static_cast<void>(answer(server_, two_way.request, "", at(1ms)));
  EXPECT_EQ(receive(oneway(3 + kCallWindow, kFlagNoReply)).action, Action::kNothing)
      << "nor is it run later";
}

// hp-4.4-1: the server sends only this, so that the client does not call in vain for ever.
TEST_F(ServerOneways, WithoutReplyOfAnUnknownSessionAreRefused) {
  ++peer_.session;
  const Verdict verdict = receive(oneway(1, kFlagNoReply));
  ASSERT_EQ(verdict.action, Action::kSend);
  EXPECT_EQ(header_of(verdict.frame).status, Status::kUnknownSession);
}

// hp-5.8-1
TEST_F(ServerOneways, ThatMayNotRunAreCountedAndNotAnswered) {
  ServerSessionsConfig config = server_config();
  config.band = {50, 150};
  config.ceiling = 120;
  ServerSessions server(config);
  peer_.open(server, at(0s));
  std::uint32_t call_id = 0;
  for (const int priority : {49, 151, 121}) {
    peer_.priority = priority;
    const Bytes frame = oneway(++call_id, kFlagNoReply);
    EXPECT_EQ(server.on_frame(frame, peer_.address, at(0s)).action, Action::kNothing);
    EXPECT_EQ(server.counters().refused_count, call_id);
  }
}

// hp-5.2-4
TEST_F(ServerOneways, DoNotHoldTheirPlace) {
  const Verdict oneway_call = receive(oneway(1, kFlagNoReply));
  ASSERT_EQ(oneway_call.action, Action::kDispatch);
  const Verdict next = receive(peer_.call_frame(1 + kCallWindow, "next"));
  ASSERT_EQ(next.action, Action::kDispatch) << "its client can't know whether the oneway runs";
  const Bytes late = answer(server_, oneway_call.request, "late", at(1ms));
  EXPECT_TRUE(late.empty());
  EXPECT_EQ(server_.counters().orphaned_count, 1u) << "its place is another call's";
  EXPECT_EQ(payload_of(answer(server_, next.request, "own", at(2ms))), bytes_of("own"));
  EXPECT_EQ(payload_of(receive(peer_.call_frame(1 + kCallWindow, "next")).frame), bytes_of("own"));
}

// hp-5.8-3
TEST_F(ServerOneways, WithReceiptAreAnsweredBeforeTheyRun) {
  const Bytes frame = oneway(1, kFlagReplyOnReceipt);
  const Verdict verdict = receive(frame, at(5ms));
  ASSERT_EQ(verdict.action, Action::kDispatch);
  ASSERT_TRUE(verdict.request.wants_receipt());
  const Bytes receipt = copy_of(server_.accept(verdict.request, Status::kOk, at(5ms + 20us)));
  const Header header = header_of(receipt);
  EXPECT_EQ(header.kind, FrameKind::kReply);
  EXPECT_EQ(header.status, Status::kOk);
  EXPECT_EQ(header.call_id, 1u);
  EXPECT_EQ(header.trace_id, 0x7aceu);
  EXPECT_EQ(header.budget_us, 20u);
  EXPECT_EQ(header.payload_size, 0u);
  EXPECT_EQ(header.flags, 0u) << "the flag is a CALL's alone (hp-2-5)";

  Bytes repeated = receipt;
  store_le(repeated.data() + 6, kFlagRepeated);
  EXPECT_EQ(copy_of(receive(frame, at(6ms)).frame), repeated) << "while it runs";
  EXPECT_TRUE(answer(server_, verdict.request, "nobody reads this", at(7ms)).empty());
  EXPECT_EQ(copy_of(receive(frame, at(8ms)).frame), repeated) << "when it ran";
  EXPECT_EQ(server_.counters().orphaned_count, 0u);
}

// hp-5.8-3
TEST_F(ServerOneways, WithReceiptSayWhyTheyWillNotRun) {
  const Bytes frame = oneway(1, kFlagReplyOnReceipt);
  const Verdict verdict = receive(frame);
  const Header header = header_of(server_.accept(verdict.request, Status::kNoSuchObject, at(1ms)));
  EXPECT_EQ(header.status, Status::kNoSuchObject);
  EXPECT_TRUE(server_.complete(verdict.request, Status::kNoSuchObject, 0, at(1ms)).empty());
  EXPECT_EQ(header_of(receive(frame).frame).status, Status::kNoSuchObject);

  EXPECT_EQ(header_of(receive(oneway(2, kFlagReplyOnReceipt, 0)).frame).status, Status::kExpired)
      << "hp-5.8-4";
}

// hp-5.8-3, hp-5.2-4
TEST_F(ServerOneways, WithReceiptDoNotHoldTheirPlaceOnceAnswered) {
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

// hp-5.8: the caller continues as soon as the frame is sent.
TEST_F(ClientOneways, WithoutReplyAreOverWhenTheyAreSent) {
  for (int i = 0; i < 20; ++i) {
    const auto frame = channel_.call(oneway(Delivery::kSent), request_, at(0s));
    ASSERT_TRUE(frame);
    const Header header = header_of(*frame);
    EXPECT_EQ(header.flags, kFlagNoReply);
    EXPECT_EQ(header.budget_us, 1'000'000u) << "it is not run after its deadline (hp-5.8-4)";
    EXPECT_EQ(payload_of(*frame), request_);
    EXPECT_TRUE(channel_.has_free_call());
    EXPECT_FALSE(channel_.is_open(channel_.last_call()));
    EXPECT_EQ(channel_.next_time(), kNever) << "it is not repeated";
  }
}

// hp-5.8-2
TEST_F(ClientOneways, WithoutReplyFitOneFrame) {
  const Bytes fits(kDatagramPayloadSizeMax);
  const Bytes large(kDatagramPayloadSizeMax + 1);
  const auto frame = channel_.call(oneway(Delivery::kSent), large, at(0s));
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error(), Status::kTooLarge);
  EXPECT_TRUE(channel_.call(oneway(Delivery::kSent), fits, at(0s)));
}

// hp-5.1-1
TEST_F(ClientOneways, HaveNumbersOfTheirOwn) {
  const Bytes first = copy_of(*channel_.call(oneway(Delivery::kSent), request_, at(0s)));
  const Bytes second = copy_of(*channel_.call(oneway(Delivery::kSent), request_, at(0s)));
  const Bytes call = begin_call(at(0s));
  EXPECT_EQ(header_of(second).call_id, header_of(first).call_id + 1);
  EXPECT_EQ(header_of(call).call_id, header_of(first).call_id + 2);
  EXPECT_EQ(channel_.on_frame(reply_frame(first, ""), at(1ms)).kind, Kind::kNothing)
      << "who answers errs";
  EXPECT_EQ(channel_.on_frame(reply_frame(call, "own"), at(1ms)).kind, Kind::kReply);
}

TEST_F(ClientOneways, LeaveACallThatIsOpenAlone) {
  // The call holds the only slot: there is none for a oneway.
  const Bytes call = begin_call(at(0s));
  EXPECT_FALSE(channel_.has_free_call());
  EXPECT_EQ(channel_.on_frame(reply_frame(call, ""), at(1ms)).kind, Kind::kReply);
}

// hp-5.5-2: the client cannot know whether a oneway ran; the next call makes a handshake.
TEST_F(ClientOneways, OfAnUnknownSessionEndTheSessionAlone) {
  const Bytes frame = copy_of(*channel_.call(oneway(Delivery::kSent), request_, at(0s)));
  EXPECT_EQ(channel_.on_frame(refuse_frame(frame, Status::kUnknownSession), at(1ms)).kind,
            Kind::kNothing);
  EXPECT_FALSE(channel_.is_ready());
}

// hp-5.8-3
TEST_F(ClientOneways, WithReceiptAreRepeatedUntilTheServerHasThem) {
  const auto frame = channel_.call(oneway(Delivery::kReceipt), request_, at(0s));
  ASSERT_TRUE(frame);
  const Bytes first = copy_of(*frame);
  EXPECT_EQ(header_of(first).flags, kFlagReplyOnReceipt);
  const ChannelEvent copy = channel_.on_time(channel_.next_time());
  ASSERT_EQ(copy.kind, Kind::kSend);
  EXPECT_EQ(header_of(copy.frame).flags, kFlagReplyOnReceipt | kFlagRepeated);
  const ChannelEvent event = channel_.on_frame(reply_frame(first, "", Status::kOk), at(9ms));
  EXPECT_EQ(event.kind, Kind::kReply);
  EXPECT_EQ(event.status, Status::kOk);
  EXPECT_EQ(channel_.next_time(), kNever);
}

// hp-5.8: each fragment of a large request, repeated or not, has the flag *reply on receipt*.
TEST_F(ClientOneways, WithReceiptSayItInEachFragment) {
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
