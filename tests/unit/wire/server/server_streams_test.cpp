#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "peers.hpp"
#include "rtpm/wire/stream.hpp"

// A server's streams: spec/hprotocol.md#hp-5.10.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;
using Action = Verdict::Action;

constexpr std::uint32_t kItemSizeMax = 300'000;

class ServerStreams : public testing::Test {
 protected:
  explicit ServerStreams(Medium medium = Medium::kDatagram)
      : medium_(medium), memory_(2 * stream_buffer_size(medium)), server_(config(medium)) {}
  void SetUp() override { peer_.open(server_, at(0s), medium_); }

  ServerSessionsConfig config(Medium medium) {
    ServerSessionsConfig config = server_config(medium);
    config.stream_memory = memory_;
    config.message_size_max = kItemSizeMax;
    return config;
  }
  Verdict receive(const Bytes& frame, MonotonicTime now = at(0s)) {
    return server_.on_frame(frame, peer_.address, now);
  }
  Header stream_header(std::uint32_t call_id, std::uint32_t window) {
    Header header = peer_.call_header(call_id);
    header.item = window;
    header.budget_us = 3'000'000;
    return header;
  }
  /// Runs a call that asks for a stream.
  Request begin(std::uint32_t call_id, std::uint32_t window, MonotonicTime now = at(0s)) {
    const Verdict verdict = receive(frame_of(stream_header(call_id, window)), now);
    EXPECT_EQ(verdict.action, Action::kDispatch);
    EXPECT_TRUE(verdict.request.wants_stream());
    return verdict.request;
  }
  /// Sends one item; empty if the caller accepts none now.
  Bytes push(const Request& request, std::string_view text = "item", MonotonicTime now = at(0s)) {
    return copy_of(server_.push_item(request, bytes_of(text), now));
  }
  int push_all(const Request& request) {
    int count = 0;
    while (!push(request).empty())
      ++count;
    return count;
  }
  Bytes credit_frame(std::uint32_t call_id, const StreamCredit& credit, std::uint32_t limit,
                     bool is_asking = false, std::uint32_t budget_us = 3'000'000) {
    Header header = peer_.call_header(call_id);
    header.kind = FrameKind::kCredit;
    header.flags = is_asking ? kFlagAckWanted : std::uint16_t{0};
    header.item = limit;
    header.budget_us = budget_us;
    Bytes payload(StreamCredit::kSize);
    encode(credit, payload);
    return frame_of(header, payload);
  }
  /// All frames that `verdict` asks to send.
  std::vector<Bytes> sent(const Verdict& verdict) {
    std::vector<Bytes> frames;
    if (verdict.action == Action::kSend) frames.push_back(copy_of(verdict.frame));
    for (ConstBytes frame; !(frame = server_.next_frame(at(0s))).empty();)
      frames.push_back(copy_of(frame));
    return frames;
  }
  std::uint64_t dropped(DropReason reason) const { return server_.counters().dropped_for(reason); }

  Medium medium_;
  Bytes memory_;
  ServerSessions server_;
  Peer peer_;
};

class ServerStreamsOnAStream : public ServerStreams {
 protected:
  ServerStreamsOnAStream() : ServerStreams(Medium::kStream) {}
};

// hp-5.10-1, hp-5.10-2
TEST_F(ServerStreams, GiveItemsUpToWhatTheCallGrants) {
  const Request request = begin(1, 3);
  for (std::uint32_t number = 0; number < 3; ++number) {
    const Bytes frame = push(request, "item " + std::to_string(number));
    const Header header = header_of(frame);
    EXPECT_EQ(header.kind, FrameKind::kItem);
    EXPECT_EQ(header.item, number);
    EXPECT_EQ(header.session, peer_.session);
    EXPECT_EQ(header.call_id, 1u);
    EXPECT_EQ(header.service, 3u);
    EXPECT_EQ(header.method, 4u);
    EXPECT_EQ(header.trace_id, 0x7aceu);
    EXPECT_EQ(payload_of(frame), bytes_of("item " + std::to_string(number)));
  }
  EXPECT_TRUE(push(request).empty());
  EXPECT_EQ(server_.counters().item_count, 3u);
}

// hp-5.10-10
TEST_F(ServerStreams, GiveItemsAsLargeAsTheirOwnOrTheirClientsLimit) {
  EXPECT_EQ(server_.item_size_max(begin(1, 3)), kItemSizeMax);
  Peer modest;
  modest.channel = 2;
  modest.message_size_max = kMessageSizeFloor;
  modest.open(server_, at(0s));
  Header header = modest.call_header(1);
  header.item = 4;
  const Verdict verdict = server_.on_frame(frame_of(header), modest.address, at(0s));
  EXPECT_EQ(server_.item_size_max(verdict.request), kMessageSizeFloor);
}

// hp-5.10-2: there is memory for two streams only.
TEST_F(ServerStreams, AreRefusedWhereThereIsNoRoom) {
  static_cast<void>(begin(1, 3));
  const Request second = begin(2, 3);
  const Verdict third = receive(frame_of(stream_header(3, 3)));
  EXPECT_EQ(header_of(third.frame).status, Status::kOverload);
  EXPECT_EQ(header_of(third.frame).kind, FrameKind::kReply);
  static_cast<void>(answer(server_, second, "", at(1ms)));
  static_cast<void>(begin(4, 3));
  ServerSessions without(server_config());
  peer_.open(without, at(0s));
  const Verdict verdict = without.on_frame(frame_of(stream_header(1, 3)), peer_.address, at(0s));
  EXPECT_EQ(header_of(verdict.frame).status, Status::kOverload);
}

// hp-5.10-4
TEST_F(ServerStreams, RepeatWhatACreditShowsToBeMissing) {
  const Request request = begin(1, 8);
  EXPECT_EQ(push_all(request), 8);
  const std::vector<Bytes> frames = sent(receive(credit_frame(1, credit(1, 0b0101), 8)));
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(header_of(frames[0]).item, 1u);
  EXPECT_EQ(header_of(frames[1]).item, 3u);
  EXPECT_EQ(header_of(frames[0]).flags, kFlagRepeated);
  EXPECT_EQ(server_.counters().item_repeated_count, 2u);
  EXPECT_EQ(push_all(request), 0);
  EXPECT_TRUE(sent(receive(credit_frame(1, credit(5, 0), 12))).empty());
  EXPECT_EQ(push_all(request), 4) << "hp-5.10-2";
}

TEST_F(ServerStreams, TellWhoFeedsThemThatThereIsCredit) {
  const Request request = begin(1, 2);
  server_.set_tag(request, 42);
  EXPECT_EQ(push_all(request), 2);
  EXPECT_EQ(receive(credit_frame(1, credit(2, 0), 4)).credit_tag, 42u);
  static_cast<void>(answer(server_, request, "", at(1ms)));
  EXPECT_EQ(receive(credit_frame(1, credit(2, 0), 6)).credit_tag, 0u) << "it has ended";
}

// hp-5.10-5: the server always answers a question.
TEST_F(ServerStreams, AnswerWhoAsks) {
  const Request request = begin(1, 8);
  std::vector<Bytes> frames = sent(receive(credit_frame(1, credit(0, 0), 8, true)));
  ASSERT_EQ(frames.size(), 1u) << "nothing was sent yet";
  Header header = header_of(frames[0]);
  EXPECT_EQ(header.kind, FrameKind::kAck);
  EXPECT_EQ(header.item, 0u);
  EXPECT_EQ(header.call_id, 1u);
  EXPECT_EQ(header.service, 3u);
  EXPECT_EQ(header.trace_id, 0x7aceu);
  EXPECT_EQ(decode_ack(payload_of(frames[0]))->first_missing, 1u);

  EXPECT_EQ(push_all(request), 8);
  frames = sent(receive(credit_frame(1, credit(7, 0), 8, true)));
  ASSERT_EQ(frames.size(), 1u) << "the tail was lost";
  EXPECT_EQ(header_of(frames[0]).kind, FrameKind::kItem);
  EXPECT_EQ(header_of(frames[0]).item, 7u);

  frames = sent(receive(credit_frame(1, credit(8, 0), 8, true)));
  ASSERT_EQ(frames.size(), 1u) << "nothing is missing";
  EXPECT_EQ(header_of(frames[0]).kind, FrameKind::kAck);
  EXPECT_EQ(header_of(frames[0]).item, 8u);
  EXPECT_TRUE(sent(receive(credit_frame(1, credit(8, 0), 8))).empty()) << "who does not ask is not";
}

// hp-5.10-5, hp-5.10-6
TEST_F(ServerStreams, EndWithTheCountOfTheirItems) {
  const Request request = begin(1, 8);
  for (int i = 0; i < 5; ++i)
    static_cast<void>(push(request));
  const Bytes reply = copy_of(server_.complete(request, Status::kOk, 0, at(1ms)));
  EXPECT_EQ(header_of(reply).kind, FrameKind::kReply);
  EXPECT_EQ(header_of(reply).item, 5u);
  EXPECT_EQ(server_.item_size_max(request), 0u);

  std::vector<Bytes> frames = sent(receive(credit_frame(1, credit(3, 0), 8, true)));
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(header_of(frames[0]).item, 3u) << "the first that is missing,";
  EXPECT_EQ(header_of(frames[0]).kind, FrameKind::kItem);
  EXPECT_EQ(header_of(frames[1]).kind, FrameKind::kReply) << "and behind it the end";
  EXPECT_EQ(header_of(frames[1]).item, 5u);
  EXPECT_EQ(header_of(frames[1]).flags, kFlagRepeated);

  frames = sent(receive(credit_frame(1, credit(5, 0), 8, true)));
  ASSERT_EQ(frames.size(), 1u) << "the items are there, the REPLY was lost";
  EXPECT_EQ(header_of(frames[0]).kind, FrameKind::kReply);
  EXPECT_EQ(header_of(frames[0]).item, 5u);
  EXPECT_TRUE(sent(receive(credit_frame(1, credit(5, 0), 8))).empty());
  EXPECT_EQ(server_.next_time(), kNever) << "the items are forgotten";
  EXPECT_EQ(header_of(receive(frame_of(stream_header(1, 8))).frame).item, 5u)
      << "a late copy of the call brings the same reply";
}

TEST_F(ServerStreams, MayEndWithoutAnItem) {
  const Request request = begin(1, 8);
  const Bytes reply = copy_of(server_.complete(request, Status::kBadRequest, 0, at(1ms)));
  EXPECT_EQ(header_of(reply).status, Status::kBadRequest);
  EXPECT_EQ(header_of(reply).item, 0u);
  EXPECT_EQ(server_.next_time(), kNever);
}

// hp-5.10-3
TEST_F(ServerStreams, SayThatTheyRunToACopyOfTheirCall) {
  const Request request = begin(1, 8);
  Header copy = stream_header(1, 8);
  copy.flags = kFlagRepeated | kFlagAckWanted;
  std::vector<Bytes> frames = sent(receive(frame_of(copy)));
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(header_of(frames[0]).kind, FrameKind::kAck);
  EXPECT_EQ(header_of(frames[0]).item, 0u) << "so many items were sent";
  EXPECT_EQ(decode_ack(payload_of(frames[0]))->first_missing, 1u);
  static_cast<void>(push(request));
  frames = sent(receive(frame_of(copy)));
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(header_of(frames[0]).item, 1u);
}

// hp-5.10-7
TEST_F(ServerStreams, EndWhereTheirCallerFellSilent) {
  const Request request = begin(1, 8, at(0s));
  server_.set_tag(request, 6);
  EXPECT_EQ(server_.next_time(), at(3s));
  static_cast<void>(receive(credit_frame(1, credit(0, 0), 8), at(2s)));
  server_.on_time(server_.next_time());
  EXPECT_EQ(server_.next_time(), at(5s)) << "it was heard";
  server_.on_time(at(5s) - 1ns);
  EXPECT_GT(server_.item_size_max(request), 0u);
  EXPECT_EQ(server_.next_cancelled(), 0u);
  server_.on_time(at(5s));
  EXPECT_EQ(server_.next_cancelled(), 6u);
  EXPECT_EQ(server_.item_size_max(request), 0u);
  EXPECT_EQ(server_.next_time(), kNever);
  EXPECT_EQ(server_.counters().expired_count, 1u);
  const Verdict late = receive(credit_frame(1, credit(0, 0), 8, true), at(6s));
  ASSERT_EQ(late.action, Action::kSend);
  EXPECT_EQ(header_of(late.frame).kind, FrameKind::kRefuse);
  EXPECT_EQ(header_of(late.frame).status, Status::kLost);
  EXPECT_TRUE(server_.complete(request, Status::kCancelled, 0, at(7s)).empty());
  EXPECT_EQ(header_of(receive(credit_frame(1, credit(0, 0), 8, true), at(8s)).frame).status,
            Status::kLost);
}

// hp-5.10-7: a stale frame does not revoke the credit of a newer one.
TEST_F(ServerStreams, OutliveAStaleCredit) {
  static_cast<void>(begin(1, 8, at(0s)));
  static_cast<void>(receive(credit_frame(1, credit(0, 0), 8, false, 3'000'000), at(1s)));
  static_cast<void>(receive(credit_frame(1, credit(0, 0), 8, false, 10), at(1s)));
  server_.on_time(server_.next_time());
  EXPECT_EQ(server_.next_time(), at(4s));
}

// hp-5.10-7: items are kept for a client that has yet to fetch them, but not for ever.
TEST_F(ServerStreams, ForgetTheirItemsWhenNobodyFetchesThem) {
  const Request request = begin(1, 8);
  static_cast<void>(push(request));
  static_cast<void>(server_.complete(request, Status::kOk, 0, at(1ms)));
  EXPECT_EQ(server_.next_time(), at(3s));
  server_.on_time(at(3s));
  EXPECT_EQ(server_.next_time(), kNever);
  EXPECT_EQ(server_.counters().expired_count, 0u) << "the call itself ended in time";
}

// hp-5.9-2
TEST_F(ServerStreams, EndWhenTheyAreCancelled) {
  const Request request = begin(1, 8);
  server_.set_tag(request, 6);
  EXPECT_FALSE(push(request).empty());
  Header cancel = peer_.call_header(1);
  cancel.kind = FrameKind::kCancel;
  static_cast<void>(receive(frame_of(cancel)));
  EXPECT_EQ(server_.next_cancelled(), 6u);
  EXPECT_EQ(server_.item_size_max(request), 0u);
  EXPECT_EQ(server_.next_time(), kNever);
  EXPECT_TRUE(server_.complete(request, Status::kCancelled, 0, at(1ms)).empty());
}

TEST_F(ServerStreams, EndWithTheirSession) {
  const Request request = begin(1, 8);
  server_.set_tag(request, 6);
  Header close;
  close.kind = FrameKind::kClose;
  close.session = peer_.session;
  static_cast<void>(receive(frame_of(close)));
  EXPECT_EQ(server_.next_cancelled(), 6u);
  EXPECT_EQ(server_.item_size_max(request), 0u);
  EXPECT_EQ(server_.next_time(), kNever);
}

// hp-5.10-8
TEST_F(ServerStreams, DropCreditThatCanNotBeRead) {
  static_cast<void>(begin(1, 8));
  Header header = peer_.call_header(1);
  header.kind = FrameKind::kCredit;
  EXPECT_EQ(receive(frame_of(header)).action, Action::kNothing);
  EXPECT_EQ(receive(frame_of(header, Bytes(17))).action, Action::kNothing);
  EXPECT_EQ(dropped(DropReason::kBadPayload), 2u);
}

// hp-5.10-8
TEST_F(ServerStreams, BelieveNoCreditForWhatWasNeverSent) {
  const Request request = begin(1, 4);
  EXPECT_EQ(push_all(request), 4);
  const std::vector<Bytes> frames = sent(receive(credit_frame(1, credit(9, 0), 100, true)));
  ASSERT_EQ(frames.size(), 1u) << "it is answered, for it asked";
  EXPECT_EQ(header_of(frames[0]).item, 4u);
  EXPECT_EQ(push_all(request), 0);
}

// hp-4.4-1, hp-5.1-4
TEST_F(ServerStreams, TakeNoCreditOfAnotherSessionOrAddress) {
  static_cast<void>(begin(1, 8));
  PeerAddress stranger = peer_.address;
  stranger.port ^= 1;
  EXPECT_EQ(server_.on_frame(credit_frame(1, credit(0, 0), 8, true), stranger, at(0s)).action,
            Action::kNothing);
  EXPECT_EQ(dropped(DropReason::kForeignAddress), 1u);
  ++peer_.session;
  const Verdict verdict = receive(credit_frame(1, credit(0, 0), 8));
  EXPECT_EQ(header_of(verdict.frame).status, Status::kUnknownSession);
}

// hp-5.10-7
TEST_F(ServerStreams, OfNoCallAreLostForWhoAsks) {
  EXPECT_EQ(header_of(receive(credit_frame(5, credit(0, 0), 8, true)).frame).status, Status::kLost);
  EXPECT_EQ(receive(credit_frame(5, credit(0, 0), 8)).action, Action::kNothing);
  EXPECT_EQ(dropped(DropReason::kUnexpected), 1u);
}

// hp-5.10-5: on TCP nothing is repeated, but questions are answered.
TEST_F(ServerStreamsOnAStream, RepeatNothingAndAnswerWhoAsks) {
  const Request request = begin(1, 100);
  EXPECT_EQ(push_all(request), 100) << "the window is for what may get lost";
  std::vector<Bytes> frames = sent(receive(credit_frame(1, credit(20, 0b10), 150, true)));
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(header_of(frames[0]).kind, FrameKind::kAck);
  EXPECT_EQ(header_of(frames[0]).item, 100u);
  EXPECT_EQ(push_all(request), 50);
  const Bytes reply = copy_of(server_.complete(request, Status::kOk, 0, at(1ms)));
  EXPECT_EQ(header_of(reply).item, 150u);
  EXPECT_EQ(server_.next_time(), kNever) << "nothing is kept";
  EXPECT_TRUE(sent(receive(credit_frame(1, credit(150, 0), 150))).empty());
}

// hp-5.10-7
TEST_F(ServerStreamsOnAStream, EndWhereTheirCallerFellSilent) {
  const Request request = begin(1, 4);
  server_.set_tag(request, 6);
  server_.on_time(at(3s));
  EXPECT_EQ(server_.next_cancelled(), 6u);
  EXPECT_EQ(header_of(receive(credit_frame(1, credit(0, 0), 8, true)).frame).status, Status::kLost);
}

// hp-5.10-7: over a connection silence is allowed, because the connection's end is reported.
TEST_F(ServerStreamsOnAStream, LastAsLongAsTheirConnectionWhereTheirCallerSaysSo) {
  Header header = stream_header(1, 4);
  header.budget_us = kBudgetUnlimited;
  const Verdict verdict = receive(frame_of(header));
  ASSERT_EQ(verdict.action, Action::kDispatch);
  server_.set_tag(verdict.request, 6);
  EXPECT_EQ(server_.next_time(), kNever);
  server_.on_time(at(10h));
  EXPECT_EQ(server_.next_cancelled(), 0u);
  EXPECT_FALSE(push(verdict.request, "item", at(10h)).empty());
  server_.end_connection(peer_.address);
  EXPECT_EQ(server_.next_cancelled(), 6u);
}

// hp-5.10-7: a stream may not hold memory for longer than a session.
TEST_F(ServerStreams, EndAfterHalfAMinuteWhateverTheirCallerStates) {
  Header header = stream_header(1, 4);
  header.budget_us = kBudgetUnlimited;
  ASSERT_EQ(receive(frame_of(header)).action, Action::kDispatch);
  EXPECT_EQ(server_.next_time(), at(30s));
}

// hp-5.10-9
TEST_F(ServerStreams, CutLargeItemsAndSendNoMoreThanTheirBytes) {
  Random random(3);
  const Bytes large = random_bytes(random, 100'000);
  const Request request = begin(1, 8);
  std::vector<Bytes> frames;
  for (ConstBytes frame; !(frame = server_.push_item(request, large, at(1ms))).empty();)
    frames.push_back(copy_of(frame));
  EXPECT_EQ(frames.size(), 32u) << "a window of them";
  EXPECT_TRUE(server_.is_item_midway(request));
  EXPECT_EQ(server_.counters().item_count, 0u);
  Bytes got;
  for (std::uint32_t number = 0; server_.is_item_midway(request) || number < frames.size();) {
    for (; number < frames.size(); ++number) {
      const Header header = header_of(frames[number]);
      EXPECT_EQ(header.item, number);
      EXPECT_EQ(header.fragment_index, number);
      EXPECT_EQ(header.message_size, large.size());
      EXPECT_EQ(header.sender_time_ns, static_cast<std::uint64_t>(to_ns(at(1ms))));
      const Bytes part = payload_of(frames[number]);
      got.insert(got.end(), part.begin(), part.end());
    }
    static_cast<void>(receive(credit_frame(1, credit(number), 8)));
    while (server_.is_item_midway(request))
      if (Bytes frame = copy_of(server_.push_item(request, large, at(2ms))); !frame.empty())
        frames.push_back(std::move(frame));
      else
        break;
  }
  EXPECT_EQ(got, large);
  EXPECT_EQ(server_.counters().item_count, 1u);
}

// hp-5.10-9: a call itself grants bytes.
TEST_F(ServerStreamsOnAStream, SendOneLargeFrameBeforeTheirFirstCredit) {
  const Bytes large(200'000);
  const Request request = begin(1, 8);
  EXPECT_EQ(server_.push_item(request, large, at(0s)).size(), kStreamFrameSizeMax);
  EXPECT_TRUE(server_.push_item(request, large, at(0s)).empty());
  StreamCredit more{.first_missing = 1, .byte_limit = 2 * kStreamBytesFirstStream};
  static_cast<void>(receive(credit_frame(1, more, 8)));
  EXPECT_FALSE(server_.push_item(request, large, at(0s)).empty());
  EXPECT_TRUE(server_.push_item(request, large, at(0s)).empty());
  more.byte_limit = kStreamBytesFirstStream;
  static_cast<void>(receive(credit_frame(1, more, 8)));
  EXPECT_TRUE(server_.push_item(request, large, at(0s)).empty()) << "nothing is taken back";
}

}  // namespace
}  // namespace rtpm::wire
