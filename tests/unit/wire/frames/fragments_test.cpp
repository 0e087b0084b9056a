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
TEST(OutgoingMessage, SendsOneWindowAndRequestsAnAck) {
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

TEST(OutgoingMessage, IgnoresAnAckOfUnsentFragments) {
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
TEST(Messages, ArriveWholeOverALossyPath) {
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

// hp-5.6-9: the properties that the first fragment was judged by, such as priority, are fixed.
TEST(IncomingMessage, RefusesAFragmentWithOtherProperties) {
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

// hp-5.6-9: a later fragment can't bypass a session's ceiling.
TEST_F(LargeCalls, KeepThePriorityOfTheirFirstFragment) {
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

TEST_F(LargeCalls, AreAnsweredWindowByWindow) {
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

}  // namespace
}  // namespace rtpm::wire
