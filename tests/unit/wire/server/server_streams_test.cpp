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

// hp-5.10-10
TEST_F(ServerStreams, LimitItemsToTheSmallerOfBothLimits) {
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
TEST_F(ServerStreams, AreRefusedWithoutMemory) {
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

TEST_F(ServerStreams, ReportCreditToTheirWriter) {
  const Request request = begin(1, 2);
  server_.set_tag(request, 42);
  EXPECT_EQ(push_all(request), 2);
  EXPECT_EQ(receive(credit_frame(1, credit(2, 0), 4)).credit_tag, 42u);
  static_cast<void>(answer(server_, request, "", at(1ms)));
  EXPECT_EQ(receive(credit_frame(1, credit(2, 0), 6)).credit_tag, 0u) << "it has ended";
}

TEST_F(ServerStreams, EndWithoutAnItem) {
  const Request request = begin(1, 8);
  const Bytes reply = copy_of(server_.complete(request, Status::kBadRequest, 0, at(1ms)));
  EXPECT_EQ(header_of(reply).status, Status::kBadRequest);
  EXPECT_EQ(header_of(reply).item, 0u);
  EXPECT_EQ(server_.next_time(), kNever);
}

// hp-5.10-7: a stale frame does not revoke the credit of a newer one.
TEST_F(ServerStreams, IgnoreTheLeaseOfAStaleCredit) {
  static_cast<void>(begin(1, 8, at(0s)));
  static_cast<void>(receive(credit_frame(1, credit(0, 0), 8, false, 3'000'000), at(1s)));
  static_cast<void>(receive(credit_frame(1, credit(0, 0), 8, false, 10), at(1s)));
  server_.on_time(server_.next_time());
  EXPECT_EQ(server_.next_time(), at(4s));
}

// hp-5.10-7: items are kept for a client that has yet to fetch them, but not for ever.
TEST_F(ServerStreams, DropItemsThatAreNotFetched) {
  const Request request = begin(1, 8);
  static_cast<void>(push(request));
  static_cast<void>(server_.complete(request, Status::kOk, 0, at(1ms)));
  EXPECT_EQ(server_.next_time(), at(3s));
  server_.on_time(at(3s));
  EXPECT_EQ(server_.next_time(), kNever);
  EXPECT_EQ(server_.counters().expired_count, 0u) << "the call itself ended in time";
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

// hp-5.10-5: on TCP nothing is repeated, but questions are answered.
TEST_F(ServerStreamsOnAStream, RepeatNothingAndAnswerQuestions) {
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

// hp-5.10-7: a stream may not hold memory for longer than a session.
TEST_F(ServerStreams, EndAfterHalfAMinuteAtTheLatest) {
  Header header = stream_header(1, 4);
  header.budget_us = kBudgetUnlimited;
  ASSERT_EQ(receive(frame_of(header)).action, Action::kDispatch);
  EXPECT_EQ(server_.next_time(), at(30s));
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
