#include <gtest/gtest.h>

#include <string>

#include "client_fixture.hpp"
#include "rtpm/wire/stream.hpp"

// A client's streams: spec/hprotocol.md#hp-5.10.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;

constexpr std::uint32_t kItemSize = 64;

class ClientStreams : public ClientChannelTest {
 protected:
  explicit ClientStreams(Medium medium = Medium::kDatagram)
      : ClientChannelTest(medium, 2), medium_(medium) {}
  void SetUp() override { make_ready(at(0s)); }

  void set_reply_buffer(CallParameters& wanted, std::uint32_t window) {
    memory_.resize(window * kItemSize);
    wanted.stream_window = window;
    wanted.stream_buffers = {.frames = memory_,
                             .frame_size = kItemSize,
                             .item = {},
                             .byte_window = stream_bytes_first(medium_)};
  }
  /// Begins a call that accepts `window` items at a time.
  void begin(std::uint32_t window = 4, Duration patience = 1h, Duration lease = kStreamLease,
             Duration silence = kStreamSilence) {
    CallParameters wanted = parameters(at(0s) + patience);
    wanted.stream_lease = lease;
    wanted.stream_silence = silence;
    set_reply_buffer(wanted, window);
    const auto frame = channel_.call(wanted, request_, at(0s));
    ASSERT_TRUE(frame);
    call_ = copy_of(*frame);
    index_ = channel_.last_call();
  }
  ChannelEvent item(std::uint32_t number, MonotonicTime now, bool is_duplicate = false) {
    Header header = answer_header(call_, FrameKind::kItem);
    header.item = number;
    header.flags = is_duplicate ? kFlagRepeated : std::uint16_t{0};
    frame_ = frame_of(header, bytes_of("item " + std::to_string(number)));
    return channel_.on_frame(frame_, now);
  }
  ChannelEvent end(std::uint32_t count, MonotonicTime now, Status status = Status::kOk) {
    Header header = answer_header(call_, FrameKind::kReply);
    header.item = count;
    header.status = status;
    return channel_.on_frame(frame_of(header), now);
  }
  ChannelEvent ack(std::uint32_t count, MonotonicTime now) {
    Header header = answer_header(call_, FrameKind::kAck);
    header.item = count;
    Bytes payload(FragmentAck::kSize);
    FragmentAck all;
    all.first_missing = 1;
    encode(all, payload);
    return channel_.on_frame(frame_of(header, payload), now);
  }
  /// Takes all available items, from number `from` on; returns how many.
  std::uint32_t drain(std::uint32_t from) {
    std::uint32_t count = 0;
    for (auto item = channel_.next_item(index_); item; item = channel_.next_item(index_)) {
      EXPECT_EQ(copy_of(*item), bytes_of("item " + std::to_string(from + count)));
      ++count;
    }
    return count;
  }
  /// Expects that `frame` is a CREDIT of the stream with these values.
  void expect_credit(ConstBytes frame, std::uint32_t first_missing, std::uint64_t later,
                     std::uint32_t limit, bool is_asking) {
    ASSERT_FALSE(frame.empty());
    const Header header = header_of(frame);
    const Header call = header_of(call_);
    EXPECT_EQ(header.kind, FrameKind::kCredit);
    EXPECT_EQ(header.session, kSession);
    EXPECT_EQ(header.call_id, call.call_id);
    EXPECT_EQ(header.service, call.service);
    EXPECT_EQ(header.method, call.method);
    EXPECT_EQ(header.priority, call.priority);
    EXPECT_EQ(header.trace_id, call.trace_id);
    EXPECT_EQ(header.item, limit);
    EXPECT_EQ(header.flags, is_asking ? kFlagAckWanted : 0);
    const auto credit = decode_credit(frame.subspan(kHeaderSize));
    ASSERT_TRUE(credit);
    EXPECT_EQ(credit->first_missing, first_missing);
    EXPECT_EQ(credit->later, later);
  }

  Medium medium_;
  Bytes memory_;
  Bytes call_;
  Bytes frame_;
  CallIndex index_ = 0;
};

class ClientStreamsOnAStream : public ClientStreams {
 protected:
  ClientStreamsOnAStream() : ClientStreams(Medium::kStream) {}
};

TEST_F(ClientStreams, StateTheDeadlineIfItIsShorterThanTheLease) {
  begin(4, 2s);
  EXPECT_EQ(header_of(call_).budget_us, 2'000'000u);
}

// hp-5.10-4
TEST_F(ClientStreams, GrantMoreAfterHalfWasRead) {
  begin(4);
  for (std::uint32_t number = 0; number < 4; ++number)
    static_cast<void>(item(number, at(1ms)));
  EXPECT_TRUE(channel_.next_frame(at(1ms)).empty()) << "nothing was taken yet";
  ASSERT_TRUE(channel_.next_item(index_));
  ASSERT_TRUE(channel_.next_item(index_));
  EXPECT_TRUE(channel_.next_frame(at(1ms)).empty()) << "one of four";
  ASSERT_TRUE(channel_.next_item(index_));
  expect_credit(channel_.next_frame(at(1ms)), 4, 0, 6, false);
  EXPECT_TRUE(channel_.next_frame(at(1ms)).empty());
}

// hp-5.10-5: at 10 Hz the client does not ask every few milliseconds.
TEST_F(ClientStreams, AskAtTheRateOfTheStream) {
  begin(4);
  MonotonicTime now = at(0s);
  for (std::uint32_t number = 0; number < 60; ++number) {
    now += 100ms;
    static_cast<void>(item(number, now));
    static_cast<void>(drain(number));
    static_cast<void>(channel_.next_frame(now));
  }
  EXPECT_GT(channel_.next_time() - now, Duration{300ms});
  EXPECT_LE(channel_.next_time() - now, Duration{500ms});
}

// hp-5.10-5: no frame is lost on this path, so the client waits for the next item without a timer.
TEST_F(ClientStreams, AskLaterOnOneHost) {
  channel_.set_on_host(true);
  begin(4);
  EXPECT_EQ(channel_.next_time(), at(kRetransmitIntervalOnHost));
  static_cast<void>(item(0, at(1ms)));
  EXPECT_EQ(channel_.next_time(), at(1ms) + kRetransmitIntervalOnHost);
}

// hp-5.10-5: an idle stream costs next to nothing, however fast it was before.
TEST_F(ClientStreams, AskLessOftenWhileNothingIsMissing) {
  begin(32);
  MonotonicTime now = at(0s);
  std::uint32_t count = 0;
  for (; count < 20; ++count)
    static_cast<void>(item(count, now += 1ms));
  EXPECT_EQ(drain(0), count);
  int ask_count = 0;
  for (const MonotonicTime end = now + 10s; channel_.next_time() < end; ++ask_count) {
    now = channel_.next_time();
    expect_credit(channel_.on_time(now).frame, count, 0, 32 + count, true);
    static_cast<void>(ack(count, now + 100us));
  }
  EXPECT_GE(ask_count, 19) << "so that both sides see that the other is there";
  EXPECT_LE(ask_count, 28);
  static_cast<void>(item(count, now + 1ms));
  EXPECT_LT(channel_.next_time(), now + 150ms)
      << "the stream is active again, so the client asks sooner";
}

// hp-5.10-5: the back-off of repeated calls does not delay the stream's questions.
TEST_F(ClientStreams, AskInTimeAfterRepeatedCalls) {
  begin(4);
  MonotonicTime now = at(0s);
  while (now < at(1s)) {
    now = channel_.next_time();
    ASSERT_EQ(channel_.on_time(now).kind, Kind::kSend);
  }
  ASSERT_GT(channel_.next_time() - now, Duration{500ms})
      << "the call itself would be repeated then";
  static_cast<void>(ack(0, now + 1ms));
  EXPECT_LE(channel_.next_time() - now, Duration{501ms});
}

// hp-5.10-7: questions may be lost, and still neither side considers the other silent.
TEST_F(ClientStreams, AskSeveralTimesWithinAShortLease) {
  begin(4, 1h, 200ms, 200ms);
  for (int i = 0; i < 100; ++i) {
    const MonotonicTime now = channel_.next_time();
    EXPECT_EQ(channel_.on_time(now).kind, Kind::kSend);
    static_cast<void>(ack(0, now));
    EXPECT_LE(channel_.next_time(), now + 50ms);
  }
}

// hp-5.10-7: a reader that is busy elsewhere asks nothing, so it is owed no answer.
TEST_F(ClientStreams, SurviveABusyReader) {
  begin(4);
  static_cast<void>(item(0, at(1ms)));
  EXPECT_EQ(drain(0), 1u);
  // The client asked, and the answer was lost; then the reader was away for long.
  ASSERT_EQ(channel_.on_time(channel_.next_time()).kind, Kind::kSend);
  const ChannelEvent event = channel_.on_time(at(9s));
  ASSERT_EQ(event.kind, Kind::kSend);
  expect_credit(event.frame, 1, 0, 5, true);
  EXPECT_EQ(item(1, at(9s)).kind, Kind::kItems);
}

// hp-5.10-7
TEST_F(ClientStreams, AreLostAfterAShorterLease) {
  begin(4, 1h, 1s, 1s);
  EXPECT_EQ(header_of(call_).budget_us, 1'000'000U);
  static_cast<void>(ack(0, at(1s)));
  ChannelEvent event;
  MonotonicTime now = at(1s);
  do {
    now = channel_.next_time();
    event = channel_.on_time(now);
    if (event.kind == Kind::kSend) {
      EXPECT_EQ(header_of(event.frame).budget_us, 1'000'000U);
    }
  } while (event.kind == Kind::kSend);
  EXPECT_EQ(event.kind, Kind::kTimeout);
  EXPECT_GE(now, at(2s));
  EXPECT_LE(now, at(2s + 500ms));
}

TEST_F(ClientStreams, EndAtTheirDeadlineWithACancel) {
  begin(4, 2s);
  for (MonotonicTime now = at(0s); now < at(2s); now += 10ms) {
    static_cast<void>(ack(0, now));
    ASSERT_NE(channel_.on_time(now).kind, Kind::kTimeout);
  }
  const ChannelEvent event = channel_.on_time(at(2s));
  EXPECT_EQ(event.kind, Kind::kTimeout);
  EXPECT_EQ(header_of(event.frame).kind, FrameKind::kCancel);
}

// hp-5.10-7
TEST_F(ClientStreams, EndWithARefusal) {
  begin(8);
  const ChannelEvent event = channel_.on_frame(refuse_frame(call_, Status::kLost), at(1ms));
  EXPECT_EQ(event.kind, Kind::kReply);
  EXPECT_EQ(event.status, Status::kLost);
  EXPECT_FALSE(channel_.is_open(index_));
  begin(8);
  EXPECT_EQ(channel_.on_frame(refuse_frame(call_, Status::kUnknownSession), at(1ms)).kind,
            Kind::kLost);
}

// The last CREDIT may reach a server that no longer has the stream, or the session.
TEST_F(ClientStreams, EndOnce) {
  for (const Status status : {Status::kExpired, Status::kUnknownSession}) {
    make_ready(at(0s));
    begin(8);
    static_cast<void>(item(0, at(1ms)));
    ASSERT_EQ(end(1, at(2ms)).kind, Kind::kReply);
    EXPECT_EQ(channel_.on_frame(refuse_frame(call_, status), at(3ms)).kind, Kind::kNothing);
    EXPECT_EQ(drain(0), 1u) << "received items stay readable";
  }
  EXPECT_FALSE(channel_.is_ready()) << "the next call makes a handshake";
}

TEST_F(ClientStreams, KeepTheirItemsAfterTheEndOfTheSession) {
  for (const int end_of_session : {0, 1, 2}) {
    make_ready(at(0s));
    begin(8);
    static_cast<void>(item(0, at(1ms)));
    static_cast<void>(item(1, at(1ms)));
    ASSERT_EQ(end(2, at(2ms)).kind, Kind::kReply);
    if (end_of_session == 0) static_cast<void>(channel_.close(at(3ms)));
    if (end_of_session == 1) channel_.reset();
    if (end_of_session == 2) make_ready(at(3ms));
    EXPECT_EQ(drain(0), 2u);
    EXPECT_FALSE(channel_.is_open(index_));
  }
}

// hp-5.10-2
TEST_F(ClientStreams, RefuseItemsThatWereNotGranted) {
  begin(4);
  EXPECT_EQ(item(4, at(1ms)).kind, Kind::kNothing);
  EXPECT_EQ(item(0x7fff'ffff, at(1ms)).kind, Kind::kNothing);
  Header header = answer_header(call_, FrameKind::kItem);
  header.item = 0;
  EXPECT_EQ(channel_.on_frame(frame_of(header, Bytes(kItemSize + 1)), at(1ms)).kind, Kind::kNothing)
      << "too large";
  EXPECT_EQ(dropped(DropReason::kUnexpected), 3u);
  EXPECT_EQ(item(0, at(1ms)).kind, Kind::kItems);
}

// hp-5.9-3: the items belong to a call that is open, but not a stream.
TEST_F(ClientStreams, RefuseItemsOfAnOrdinaryCall) {
  call_ = begin_call(at(0s));
  EXPECT_EQ(item(0, at(1ms)).kind, Kind::kNothing);
  EXPECT_EQ(dropped(DropReason::kUnexpected), 1u);
}

// A request in fragments may ask for a stream, which begins when the request is complete.
TEST_F(ClientStreams, AcceptALargeRequest) {
  const Bytes large(1500);
  CallParameters wanted = parameters(at(1h));
  set_reply_buffer(wanted, 4);
  const auto first = channel_.call(wanted, large, at(0s));
  ASSERT_TRUE(first);
  call_ = copy_of(*first);
  index_ = channel_.last_call();
  EXPECT_EQ(header_of(call_).item, 4u);
  EXPECT_EQ(header_of(channel_.next_frame(at(0s))).item, 4u);
  // The ACK of the fragments has the same form as the stream's.
  Header header = header_of(call_);
  header.kind = FrameKind::kAck;
  header.item = 0;
  Bytes payload(FragmentAck::kSize);
  FragmentAck all;
  all.first_missing = 2;
  encode(all, payload);
  header.flags = 0;
  header.fragment_count = 1;
  header.fragment_index = 0;
  static_cast<void>(channel_.on_frame(frame_of(header, payload), at(1ms)));
  const ChannelEvent event = channel_.on_time(channel_.next_time());
  ASSERT_EQ(event.kind, Kind::kSend);
  expect_credit(event.frame, 0, 0, 4, true);
}

// hp-5.10-7
TEST_F(ClientStreamsOnAStream, StateNoLimitOverAConnection) {
  begin(4, 10h, 10h);
  EXPECT_EQ(header_of(call_).budget_us, kBudgetUnlimited);
}

// hp-5.10-9: the client grants more bytes as soon as the server has the call.
TEST_F(ClientStreamsOnAStream, GrantTheirByteWindowAfterTheFirstItem) {
  CallParameters wanted = parameters(at(1h));
  set_reply_buffer(wanted, 4);
  wanted.stream_buffers.byte_window = 4 * kStreamBytesFirstStream;
  const auto frame = channel_.call(wanted, request_, at(0s));
  ASSERT_TRUE(frame);
  call_ = copy_of(*frame);
  index_ = channel_.last_call();
  EXPECT_EQ(drain(0), 0u);
  EXPECT_TRUE(channel_.next_frame(at(0s)).empty());
  static_cast<void>(item(0, at(1ms)));
  const ConstBytes credit = channel_.next_frame(at(1ms));
  ASSERT_FALSE(credit.empty());
  EXPECT_EQ(decode_credit(credit.subspan(kHeaderSize))->byte_limit, 4 * kStreamBytesFirstStream);
}

// hp-5.10-5
TEST_F(ClientStreamsOnAStream, AskLaterAfterAnItem) {
  begin(4);
  static_cast<void>(item(0, at(1ms)));
  EXPECT_EQ(channel_.next_time(), at(1ms) + kStreamAskIntervalConnected);
}

// hp-5.10-7
TEST_F(ClientStreamsOnAStream, AreLostAfterThreeSilentSeconds) {
  begin(4);
  ChannelEvent event;
  do {
    event = channel_.on_time(channel_.next_time());
  } while (event.kind == Kind::kSend);
  EXPECT_EQ(event.kind, Kind::kTimeout);
}

}  // namespace
}  // namespace rtpm::wire
