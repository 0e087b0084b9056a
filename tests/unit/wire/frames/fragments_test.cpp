#include <gtest/gtest.h>

#include <algorithm>
#include <deque>

#include "client_fixture.hpp"
#include "peers.hpp"
#include "rtpm/wire/fragments.hpp"

// Messages larger than a frame: spec/hprotocol.md#hp-5.6.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;
using Action = Verdict::Action;
using Taken = IncomingMessage::Taken;

Bytes pattern(std::size_t size) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i)
    bytes[i] = static_cast<std::byte>(i * 7 + (i >> 8));
  return bytes;
}

Header part(std::uint16_t index, std::uint16_t count, std::uint32_t size, std::uint32_t message) {
  Header header;
  header.fragment_index = index;
  header.fragment_count = count;
  header.payload_size = size;
  header.message_size = message;
  return header;
}

// hp-5.6-2, hp-5.6-3
TEST(OutgoingMessage, SendsOneWindowAndAsksHowFarItGot) {
  const Bytes message = pattern(100 * 100);
  OutgoingMessage outgoing;
  outgoing.begin({}, message, 100, kFragmentWindow);
  Bytes frame(kHeaderSize + 100);
  int count = 0;
  Header last;
  for (ConstBytes sent; !(sent = outgoing.next(frame, 1, at(0s))).empty(); ++count) {
    last = header_of(sent);
    EXPECT_EQ(last.fragment_index, count);
    EXPECT_EQ(last.fragment_count, 100u);
  }
  EXPECT_EQ(count, kFragmentWindow);
  EXPECT_NE(last.flags & kFlagAckWanted, 0);

  FragmentAck ack;
  ack.first_missing = 10;
  ack.later[0] = 1U << 4U;  // Fragment 15 has arrived, 10 to 14 have not.
  outgoing.on_ack(ack);
  std::vector<int> indices;
  for (ConstBytes sent; !(sent = outgoing.next(frame, 1, at(0s))).empty();) {
    indices.push_back(header_of(sent).fragment_index);
  }
  // hp-5.6-6: fragments before one that arrived are lost; then the window moves by ten.
  EXPECT_EQ(indices,
            (std::vector<int>{10, 11, 12, 13, 14, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41}));
  outgoing.nudge();
  EXPECT_EQ(header_of(outgoing.next(frame, 1, at(0s))).fragment_index, 10u);
}

TEST(OutgoingMessage, LearnsNothingFromAnAckOfWhatItNeverSent) {
  const Bytes message = pattern(10 * 100);
  OutgoingMessage outgoing;
  outgoing.begin({}, message, 100, 2);
  Bytes frame(kHeaderSize + 100);
  static_cast<void>(outgoing.next(frame, 1, at(0s)));
  FragmentAck ack;
  ack.first_missing = 10;
  outgoing.on_ack(ack);
  EXPECT_FALSE(outgoing.is_acknowledged());
}

// hp-5.6-6: despite loss, duplication and reordering the message arrives, byte for byte.
TEST(Messages, ArriveWholeWhateverHappensOnTheWay) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    Random random(seed);
    const Bytes message = pattern(2 + random() % 20'000);
    const auto fragment_size =
        static_cast<std::uint32_t>(1 + random() % std::min<std::size_t>(message.size() - 1, 500));
    if (message.size() / fragment_size > 2000) continue;
    OutgoingMessage outgoing;
    outgoing.begin({}, message, fragment_size, kFragmentWindow);
    IncomingMessage incoming;
    Bytes buffer(message.size());
    std::deque<Bytes> on_the_way;
    Bytes frame(kHeaderSize + fragment_size);
    for (int idle = 0; !outgoing.is_acknowledged(); ++idle) {
      ASSERT_LT(idle, 1'000'000) << "seed " << seed;
      for (ConstBytes sent; !(sent = outgoing.next(frame, 1, at(0s))).empty();) {
        for (std::uint64_t copies = random() % 10 < 2 ? 0 : 1 + random() % 2; copies > 0;
             --copies) {
          const auto place = static_cast<std::ptrdiff_t>(random() % (on_the_way.size() + 1));
          on_the_way.insert(on_the_way.begin() + place, copy_of(sent));
        }
      }
      if (on_the_way.empty()) {
        outgoing.nudge();
        continue;
      }
      const Bytes arrived = on_the_way.front();
      on_the_way.pop_front();
      const Header header = header_of(arrived);
      if (!incoming.is_begun()) incoming.begin(header, buffer);
      ASSERT_NE(incoming.take(header, ConstBytes(arrived).subspan(kHeaderSize)), Taken::kForeign);
      const bool is_answered = (header.flags & kFlagAckWanted) != 0 && random() % 10 >= 2;
      if (is_answered) outgoing.on_ack(incoming.ack());
    }
    EXPECT_TRUE(incoming.is_complete());
    EXPECT_EQ(copy_of(incoming.message()), message) << "seed " << seed;
  }
}

TEST(IncomingMessage, TakesNoFragmentOfAnother) {
  Bytes buffer(1000);
  IncomingMessage incoming;
  incoming.begin(part(0, 3, 100, 250), buffer);
  EXPECT_EQ(incoming.take(part(0, 3, 100, 250), Bytes(100)), Taken::kNew);
  EXPECT_EQ(incoming.take(part(0, 3, 100, 250), Bytes(100)), Taken::kDuplicate);
  EXPECT_EQ(incoming.take(part(1, 3, 100, 251), Bytes(100)), Taken::kForeign);
  EXPECT_EQ(incoming.take(part(1, 3, 99, 250), Bytes(99)), Taken::kForeign);
  EXPECT_EQ(incoming.take(part(2, 3, 50, 250), Bytes(50)), Taken::kNew);
  EXPECT_EQ(incoming.take(part(1, 3, 100, 250), Bytes(100)), Taken::kLast);
}

// hp-5.6-9: the properties that the first fragment was judged by, such as priority, are fixed.
TEST(IncomingMessage, TakesNoFragmentThatSaysOtherwise) {
  Bytes buffer(1000);
  IncomingMessage incoming;
  incoming.begin(part(0, 3, 100, 250), buffer);
  const auto offer = [&](auto change) {
    Header header = part(1, 3, 100, 250);
    change(header);
    return incoming.take(header, Bytes(100));
  };
  EXPECT_EQ(offer([](Header& h) { ++h.service; }), Taken::kForeign);
  EXPECT_EQ(offer([](Header& h) { ++h.method; }), Taken::kForeign);
  EXPECT_EQ(offer([](Header& h) { h.priority = 1; }), Taken::kForeign);
  EXPECT_EQ(offer([](Header& h) { h.item = 4; }), Taken::kForeign);
  EXPECT_EQ(offer([](Header& h) { h.flags = kFlagReplyOnReceipt; }), Taken::kForeign);
  const auto changes_with_time = [](Header& h) {
    h.flags = kFlagRepeated | kFlagAckWanted;
    h.budget_us = 7;
    h.sender_time_ns = 8;
  };
  EXPECT_EQ(offer(changes_with_time), Taken::kNew);
}

constexpr std::uint32_t kLarge = 64 * 1024;

class LargeCalls : public testing::Test {
 protected:
  explicit LargeCalls(std::size_t buffer_count = 3)
      : large_(buffer_count * kLarge), server_(config()) {}
  void SetUp() override { peer_.open(server_, at(0s)); }

  ServerSessionsConfig config() {
    ServerSessionsConfig config = server_config();
    config.message_size_max = kLarge;
    config.large_memory = large_;
    return config;
  }
  /// All fragments of a call with `message`.
  std::vector<Bytes> fragments(std::uint32_t call_id, ConstBytes message) {
    const Header header = header_of(peer_.call_frame(call_id, ""));
    OutgoingMessage outgoing;
    outgoing.begin(header, message, kDatagramPayloadSizeMax, kFragmentCountMax - 1);
    Bytes frame(kDatagramFrameSizeMax);
    std::vector<Bytes> all;
    for (ConstBytes sent; !(sent = outgoing.next(frame, header.budget_us, at(0s))).empty();) {
      all.push_back(copy_of(sent));
    }
    return all;
  }
  Verdict receive(const Bytes& frame, MonotonicTime now = at(0s)) {
    return server_.on_frame(frame, peer_.address, now);
  }
  Bytes ack_frame(std::uint32_t call_id, const FragmentAck& ack) {
    Bytes payload(FragmentAck::kSize);
    encode(ack, payload);
    return frame_of(header_about(header_of(peer_.call_frame(call_id, "")), FrameKind::kAck,
                                 FragmentAck::kSize, at(0s)),
                    payload);
  }

  Bytes large_;
  ServerSessions server_;
  Peer peer_;
};

TEST_F(LargeCalls, RunOnceWithTheWholeMessage) {
  const Bytes message = pattern(10'000);
  std::vector<Bytes> all = fragments(1, message);
  std::reverse(all.begin(), all.end());
  all.insert(all.begin() + 3, all.front());
  int run_count = 0;
  for (const Bytes& frame : all) {
    const Verdict verdict = receive(frame);
    if (verdict.action != Action::kDispatch) continue;
    ++run_count;
    EXPECT_EQ(copy_of(verdict.request.payload), message);
  }
  EXPECT_EQ(run_count, 1);
  // hp-5.2-1, hp-5.6-4: while the call runs, a duplicate is answered with a complete ACK.
  const Verdict verdict = receive(fragments(1, message).back());
  ASSERT_EQ(verdict.action, Action::kSend);
  EXPECT_EQ(header_of(verdict.frame).kind, FrameKind::kAck);
  EXPECT_EQ(decode_ack(verdict.frame.subspan(kHeaderSize))->first_missing, 8u);
}

// hp-5.6-9: a later fragment can't bypass a session's ceiling.
TEST_F(LargeCalls, KeepThePriorityThatWasJudged) {
  std::vector<Bytes> all = fragments(1, pattern(2000));
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(receive(all[0]).action, Action::kNothing);
  Bytes higher = all[1];
  store_le(higher.data() + 4, static_cast<std::uint16_t>(Priority::kHighest));
  EXPECT_EQ(receive(higher).action, Action::kNothing);
  EXPECT_EQ(server_.counters().dropped_for(DropReason::kBadFragment), 1u);
  const Verdict verdict = receive(all[1]);
  ASSERT_EQ(verdict.action, Action::kDispatch);
  EXPECT_EQ(verdict.request.header.priority, peer_.priority);
}

TEST_F(LargeCalls, AreAnsweredInWindowsUntilAllHasArrived) {
  const Verdict verdict = receive(peer_.call_frame(1, "small"));
  ASSERT_EQ(verdict.action, Action::kDispatch);
  const Bytes reply = pattern(kLarge);
  const MutableBytes buffer = server_.reply_buffer(verdict.request, at(0s));
  ASSERT_EQ(buffer.size(), kLarge);
  std::ranges::copy(reply, buffer.begin());
  IncomingMessage incoming;
  Bytes collected(kLarge);
  const auto take = [&](ConstBytes frame) {
    int count = 0;
    for (; !frame.empty(); frame = server_.next_frame(at(0s)), ++count) {
      const Header header = header_of(frame);
      EXPECT_EQ(header.kind, FrameKind::kReply);
      if (!incoming.is_begun()) incoming.begin(header, collected);
      static_cast<void>(incoming.take(header, frame.subspan(kHeaderSize)));
    }
    return count;
  };
  EXPECT_EQ(take(server_.complete(verdict.request, Status::kOk, kLarge, at(0s))), kFragmentWindow);
  EXPECT_EQ(take(receive(ack_frame(1, incoming.ack())).frame), 49 - kFragmentWindow);
  EXPECT_TRUE(incoming.is_complete());
  EXPECT_EQ(copy_of(incoming.message()), reply);
  // hp-5.6-7: a duplicate of the call fetches the fragments that are not acknowledged yet.
  EXPECT_GE(take(receive(peer_.call_frame(1, "small")).frame), 1);
  // hp-5.6-8
  EXPECT_EQ(receive(ack_frame(1, incoming.ack())).action, Action::kNothing);
  EXPECT_EQ(receive(peer_.call_frame(1, "small")).action, Action::kNothing);
  EXPECT_EQ(server_.counters().dropped_for(DropReason::kStaleCall), 1u);
}

/// A client and a server that exchange a large reply over a lossy path.
class LargeExchange : public ClientChannelTest {
 protected:
  LargeExchange() : large_(3 * kLarge), buffer_(kLarge), server_(config()) {}
  void SetUp() override {
    Bytes hello = copy_of(channel_.open(120, at(1s), at(0s)));
    for (int step = 0; step < 2; ++step) {
      const Verdict verdict = server_.on_frame(hello, kAddress, at(0s));
      hello = copy_of(channel_.on_frame(verdict.frame, at(0s)).frame);
    }
    ASSERT_TRUE(channel_.is_ready());
    channel_.set_reply_buffer(buffer_);
  }
  ServerSessionsConfig config() {
    ServerSessionsConfig config = server_config();
    config.message_size_max = kLarge;
    config.large_memory = large_;
    return config;
  }
  /// All frames of a reply of `size` bytes to a new call.
  std::vector<Bytes> reply_to_a_call(std::size_t size) {
    const Verdict verdict = server_.on_frame(begin_call(at(0s), 10s), kAddress, at(0s));
    EXPECT_EQ(verdict.action, Action::kDispatch);
    std::ranges::copy(pattern(size), server_.reply_buffer(verdict.request, at(0s)).begin());
    std::vector<Bytes> frames{copy_of(
        server_.complete(verdict.request, Status::kOk, static_cast<std::uint32_t>(size), at(0s)))};
    for (ConstBytes frame; !(frame = server_.next_frame(at(0s))).empty();)
      frames.push_back(copy_of(frame));
    return frames;
  }

  static constexpr PeerAddress kAddress{.low = 1, .port = 2};
  Bytes large_;
  Bytes buffer_;
  ServerSessions server_;
};

// hp-5.6-7: no later fragment reveals that the last ones were lost; the client's question does.
TEST_F(LargeExchange, RepairsATailThatWasLost) {
  std::vector<Bytes> frames = reply_to_a_call(2900);
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(channel_.on_frame(frames[0], at(1ms)).kind, Kind::kNothing);
  ChannelEvent event;
  for (int question = 0; question < 5 && event.kind != Kind::kReply; ++question) {
    const MonotonicTime now = channel_.next_time();
    const ChannelEvent asked = channel_.on_time(now);
    ASSERT_EQ(asked.kind, Kind::kSend);
    EXPECT_EQ(header_of(asked.frame).kind, FrameKind::kAck);
    EXPECT_EQ(header_of(asked.frame).flags, kFlagAckWanted);
    const Verdict verdict = server_.on_frame(asked.frame, kAddress, now);
    ASSERT_EQ(verdict.action, Action::kSend);
    event = channel_.on_frame(copy_of(verdict.frame), now);
    if (!event.frame.empty() && event.kind == Kind::kSend) {
      static_cast<void>(server_.on_frame(copy_of(event.frame), kAddress, now));
    }
  }
  ASSERT_EQ(event.kind, Kind::kReply);
  EXPECT_EQ(copy_of(event.payload), pattern(2900));
  EXPECT_EQ(server_.on_frame(copy_of(event.frame), kAddress, at(1s)).action, Action::kNothing)
      << "all is there";
}

class LargeReplies : public ClientChannelTest {
 protected:
  void SetUp() override { make_ready(at(0s)); }
  std::vector<Bytes> reply_fragments(const Bytes& call, ConstBytes message) {
    OutgoingMessage outgoing;
    outgoing.begin(answer_header(call, FrameKind::kReply), message, 500, kFragmentWindow);
    Bytes frame(kHeaderSize + 500);
    std::vector<Bytes> all;
    for (ConstBytes sent; !(sent = outgoing.next(frame, 0, at(0s))).empty();) {
      all.push_back(copy_of(sent));
    }
    return all;
  }
};

TEST_F(LargeReplies, AskForRoomAndAreAcknowledged) {
  const Bytes call = begin_call(at(0s));
  const Bytes message = pattern(2900);
  const std::vector<Bytes> all = reply_fragments(call, message);
  const ChannelEvent first = channel_.on_frame(all[1], at(1ms));
  ASSERT_EQ(first.kind, Kind::kNeedBuffer);
  ASSERT_EQ(first.reply_size, 2900u);
  Bytes buffer(2900);
  channel_.set_reply_buffer(buffer);
  EXPECT_EQ(channel_.on_frame(all[1], at(1ms)).kind, Kind::kNothing);
  // hp-5.6-7: when no more fragments arrive, the client reports its progress.
  const ChannelEvent late = channel_.on_time(channel_.next_time());
  ASSERT_EQ(late.kind, Kind::kSend);
  EXPECT_EQ(header_of(late.frame).kind, FrameKind::kAck);
  EXPECT_EQ(decode_ack(late.frame.subspan(kHeaderSize))->first_missing, 0u);
  ChannelEvent event;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i != 1) event = channel_.on_frame(all[i], at(20ms));
  }
  ASSERT_EQ(event.kind, Kind::kReply);
  EXPECT_EQ(copy_of(event.payload), message);
  EXPECT_EQ(decode_ack(event.frame.subspan(kHeaderSize))->first_missing, 6u);
  EXPECT_EQ(channel_.next_time(), kNever);
}

}  // namespace
}  // namespace rtpm::wire
