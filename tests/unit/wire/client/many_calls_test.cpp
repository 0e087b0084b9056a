#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>

#include "client_fixture.hpp"

// Several concurrent calls of one channel: spec/hprotocol.md#hp-4.3, #hp-5.1.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;

class ManyCalls : public ClientChannelTest {
 protected:
  ManyCalls() : ClientChannelTest(Medium::kDatagram, kCallWindow) {}

  /// Opens the channel to a server that grants `window` calls at a time.
  void make_ready_with(std::uint16_t window, std::uint64_t session = kSession) {
    Welcome granted = welcome();
    granted.window = window;
    const Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
    ASSERT_EQ(channel_.on_frame(welcome_frame(hello, granted, session), at(0s)).kind, Kind::kReady);
  }
  /// Begins calls until the window is full.
  std::vector<Bytes> fill() {
    std::vector<Bytes> calls;
    while (channel_.has_free_call())
      calls.push_back(begin_call(at(0s)));
    return calls;
  }
};

// hp-4.3-2
TEST_F(ManyCalls, AreAsManyAsBothSidesAllow) {
  for (const auto& [window, count] :
       {std::pair<std::uint16_t, std::size_t>{1, 1}, {2, 2}, {4, 4}, {8, 8}, {16, 8}, {32768, 8}}) {
    make_ready_with(window);
    EXPECT_EQ(fill().size(), count) << window;
  }
}

// hp-5.1-3: all parts of the answer must belong to the same call.
TEST_F(ManyCalls, RefuseAReplyThatMixesTwoCalls) {
  make_ready_with(8);
  const Bytes one = begin_call(at(0s));
  CallParameters other_method = parameters(at(1s));
  other_method.method = 9;
  ASSERT_TRUE(channel_.call(other_method, request_, at(0s)));
  Header mixed = answer_header(one, FrameKind::kReply);
  mixed.method = 9;
  EXPECT_EQ(channel_.on_frame(frame_of(mixed), at(1ms)).kind, Kind::kNothing);
  EXPECT_EQ(dropped(DropReason::kUnexpected), 1u);
}

// hp-4.3-2, hp-5.1-1: the client skips numbers whose slot at the server is taken.
TEST_F(ManyCalls, SkipNumbersWhoseSlotIsTaken) {
  for (const std::uint16_t window : {std::uint16_t{1}, std::uint16_t{2}, std::uint16_t{4},
                                     std::uint16_t{8}, std::uint16_t{256}}) {
    make_ready_with(window);
    Random random(window);
    std::vector<Bytes> open;
    std::uint32_t newest = 0;
    for (int step = 0; step < 500; ++step) {
      if (channel_.has_free_call() && random() % 3 != 0) {
        open.push_back(begin_call(at(0s)));
        const std::uint32_t call_id = header_of(open.back()).call_id;
        if (newest != 0) {
          EXPECT_GT(call_id, newest) << "upward";
          EXPECT_LE(call_id, newest + kCallWindow) << "and not further than needed";
        }
        newest = call_id;
        for (std::size_t i = 0; i + 1 < open.size(); ++i) {
          EXPECT_NE((call_id - header_of(open[i]).call_id) % window, 0u)
              << "window " << window << ": " << call_id << " while " << header_of(open[i]).call_id
              << " is open";
        }
      } else if (!open.empty()) {
        const auto one = open.begin() + static_cast<std::ptrdiff_t>(random() % open.size());
        ASSERT_EQ(channel_.on_frame(reply_frame(*one, ""), at(0s)).kind, Kind::kReply);
        open.erase(one);
      }
    }
  }
}

TEST_F(ManyCalls, AreRepeatedAndTimeOutIndependently) {
  make_ready_with(8);
  const Bytes first = begin_call(at(0s), 100ms);
  const CallIndex first_index = channel_.last_call();
  const Bytes second = begin_call(at(2ms), 4ms);
  const CallIndex second_index = channel_.last_call();
  EXPECT_EQ(channel_.next_time(), at(5ms)) << "the first one's copy";
  ChannelEvent event = channel_.on_time(at(5ms));
  ASSERT_EQ(event.kind, Kind::kSend);
  EXPECT_EQ(event.call, first_index);
  EXPECT_EQ(header_of(event.frame).call_id, header_of(first).call_id);
  EXPECT_EQ(channel_.on_time(at(5ms)).kind, Kind::kNothing);
  EXPECT_EQ(channel_.next_time(), at(6ms)) << "the second one's deadline";
  event = channel_.on_time(at(6ms));
  EXPECT_EQ(event.kind, Kind::kTimeout);
  EXPECT_EQ(event.call, second_index);
  EXPECT_TRUE(channel_.is_open(first_index));
}

// Calls that expire at the same time are reported one by one.
TEST_F(ManyCalls, ReportEachExpiredCall) {
  make_ready_with(8);
  for (int i = 0; i < 8; ++i)
    static_cast<void>(begin_call(at(0s), 3ms));
  std::set<CallIndex> ended;
  for (ChannelEvent event = channel_.on_time(at(1s)); event.kind != Kind::kNothing;
       event = channel_.on_time(at(1s))) {
    EXPECT_EQ(event.kind, Kind::kTimeout);
    ended.insert(event.call);
  }
  EXPECT_EQ(ended.size(), 8u);
}

// hp-5.5-2: all calls are over; the start of each decides whether it may be sent again.
TEST_F(ManyCalls, AreLostWithTheSession) {
  make_ready_with(8);
  const std::vector<Bytes> calls = fill();
  const ChannelEvent event =
      channel_.on_frame(refuse_frame(calls[3], Status::kUnknownSession), at(1ms));
  EXPECT_EQ(event.kind, Kind::kLost);
  for (CallIndex i = 0; i < kCallWindow; ++i)
    EXPECT_FALSE(channel_.is_open(i));
  EXPECT_FALSE(channel_.is_ready());
  EXPECT_EQ(channel_.next_time(), kNever);
  EXPECT_EQ(channel_.on_frame(reply_frame(calls[0], ""), at(2ms)).kind, Kind::kNothing);
}

// hp-4.5-2: without a session there is nothing to close, whatever session a stray CLOSE names.
TEST_F(ManyCalls, IgnoreACloseWithoutASession) {
  Header close;
  close.kind = FrameKind::kClose;
  EXPECT_EQ(channel_.on_frame(frame_of(close), at(0s)).kind, Kind::kNothing);
  static_cast<void>(channel_.open(120, at(1s), at(0s)));
  EXPECT_EQ(channel_.on_frame(frame_of(close), at(0s)).kind, Kind::kNothing);
  EXPECT_EQ(dropped(DropReason::kUnexpected), 2u);
}

// Requests in fragments share the path: each has its own window, and all are sent.
TEST_F(ManyCalls, SendTheirFragmentsConcurrently) {
  Welcome generous = welcome();
  generous.message_size_max = kMessageSizeCeiling;
  const Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
  ASSERT_EQ(channel_.on_frame(welcome_frame(hello, generous), at(0s)).kind, Kind::kReady);
  const Bytes large(2900, std::byte{1});
  const Bytes other(2900, std::byte{2});
  std::map<std::uint32_t, int> count_by_call;
  for (const Bytes* message : {&large, &other}) {
    const auto first = channel_.call(parameters(at(1s)), *message, at(0s));
    ASSERT_TRUE(first);
    ++count_by_call[header_of(*first).call_id];
  }
  for (ConstBytes frame; !(frame = channel_.next_frame(at(0s))).empty();)
    ++count_by_call[header_of(frame).call_id];
  ASSERT_EQ(count_by_call.size(), 2u);
  for (const auto& [call_id, count] : count_by_call)
    EXPECT_EQ(count, 3) << call_id;
}

// Each large reply needs its own buffer.
TEST_F(ManyCalls, CollectTheirLargeRepliesConcurrently) {
  make_ready_with(8);
  Bytes buffers[2]{Bytes(2000), Bytes(2000)};
  std::vector<Bytes> calls;
  for (Bytes& buffer : buffers) {
    calls.push_back(begin_call(at(0s)));
    channel_.set_reply_buffer(buffer, channel_.last_call());
  }
  const auto fragment = [&](std::size_t call, std::uint16_t index) {
    Header header = answer_header(calls[call], FrameKind::kReply);
    header.fragment_index = index;
    header.fragment_count = 2;
    header.message_size = 2000;
    header.payload_size = 1000;
    Bytes frame(kHeaderSize + 1000, static_cast<std::byte>(call + 1));
    encode(header, frame.data());
    return channel_.on_frame(frame, at(1ms));
  };
  EXPECT_EQ(fragment(0, 0).kind, Kind::kNothing);
  EXPECT_EQ(fragment(1, 1).kind, Kind::kNothing);
  for (const std::size_t call : {1u, 0u}) {
    const ChannelEvent event = fragment(call, call == 1 ? 0 : 1);
    ASSERT_EQ(event.kind, Kind::kReply);
    EXPECT_EQ(copy_of(event.payload), Bytes(2000, static_cast<std::byte>(call + 1)));
  }
}

}  // namespace
}  // namespace rtpm::wire
