#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "peers.hpp"

// A server's calls: spec/hprotocol.md#hp-5.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;
using Action = Verdict::Action;

class ServerCalls : public testing::Test {
 protected:
  void SetUp() override { peer_.open(server_, at(0s)); }

  Verdict receive(const Bytes& frame, MonotonicTime now = at(0s)) {
    return server_.on_frame(frame, peer_.address, now);
  }
  Verdict call(std::uint32_t call_id, MonotonicTime now = at(0s)) {
    return receive(peer_.call_frame(call_id, "request " + std::to_string(call_id)), now);
  }
  /// Calls and answers at once; returns the reply.
  Bytes call_and_answer(std::uint32_t call_id, MonotonicTime now = at(0s)) {
    const Verdict verdict = call(call_id, now);
    EXPECT_EQ(verdict.action, Action::kDispatch);
    if (verdict.action != Action::kDispatch) return {};
    return answer(server_, verdict.request, "reply " + std::to_string(call_id), now);
  }
  std::uint64_t dropped(DropReason reason) const { return server_.counters().dropped_for(reason); }

  ServerSessions server_{server_config()};
  Peer peer_;
};

// hp-5.1-1
TEST_F(ServerCalls, AreNumberedInACircle) {
  const std::uint32_t begin = 0u - 3 * kCallWindow;
  for (std::uint32_t i = 0; i < 6 * kCallWindow; ++i) {
    call_and_answer(begin + i);
    EXPECT_EQ(call(begin + i).action, Action::kSend);
    if (i >= kCallWindow) {
      EXPECT_EQ(call(begin + i - kCallWindow).action, Action::kNothing) << i;
    }
  }
  EXPECT_EQ(dropped(DropReason::kStaleCall), 5u * kCallWindow);
}

TEST_F(ServerCalls, GetABufferOfTheirClientsLimit) {
  const Verdict datagram = call(1);
  EXPECT_EQ(server_.reply_buffer(datagram.request, at(0s)).size(), kDatagramPayloadSizeMax);
  Peer modest;
  modest.channel = 2;
  modest.message_size_max = kMessageSizeFloor;
  modest.open(server_, at(0s));
  for (std::uint32_t call_id = 1; call_id <= kCallWindow; ++call_id) {
    const Verdict verdict = server_.on_frame(modest.call_frame(call_id), modest.address, at(0s));
    const MutableBytes reply = server_.reply_buffer(verdict.request, at(0s));
    EXPECT_EQ(reply.size(), kMessageSizeFloor);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(reply.data()) % 16, 0u);
    std::ranges::fill(reply, static_cast<std::byte>(call_id));
    static_cast<void>(server_.complete(verdict.request, Status::kOk, kMessageSizeFloor, at(0s)));
  }
  for (std::uint32_t call_id = 1; call_id <= kCallWindow; ++call_id) {
    const Verdict again = server_.on_frame(modest.call_frame(call_id), modest.address, at(0s));
    EXPECT_EQ(payload_of(again.frame), Bytes(kMessageSizeFloor, static_cast<std::byte>(call_id)));
  }
}

TEST(ServerDeadline, IsExactForTheLargestBudget) {
  ServerSessions server(server_config());
  Peer peer;
  peer.open(server, at(0s));
  Header header = peer.call_header(1);
  header.budget_us = ~std::uint32_t{0};
  const Verdict verdict = server.on_frame(frame_of(header), peer.address, at(0s));
  ASSERT_EQ(verdict.action, Action::kDispatch);
  EXPECT_EQ(verdict.request.deadline, at(std::chrono::microseconds{~std::uint32_t{0}}));
}

/// Random calls, copies and late ends of calls in one session, compared with the spec's promises.
class CallHistory {
 public:
  explicit CallHistory(std::uint64_t seed) : random_(seed) {
    peer_.open(server_, at(0s));
    next_call_ = static_cast<std::uint32_t>(random_());
  }

  void step() {
    const std::uint32_t choice = static_cast<std::uint32_t>(random_() % 10);
    if (choice < 3) {
      receive(next_call_++);
    } else if (choice < 7) {
      receive(next_call_ - 1 - static_cast<std::uint32_t>(random_() % (3 * kCallWindow)));
    } else if (!running_.empty()) {
      const auto one =
          std::next(running_.begin(), static_cast<std::ptrdiff_t>(random_() % running_.size()));
      const std::string text = "reply " + std::to_string(random_());
      replies_[one->first] = payload_of(answer(server_, one->second, text, at(0s)));
      running_.erase(one);
    }
  }

  [[nodiscard]] std::size_t run_count() const { return run_.size(); }

 private:
  void receive(std::uint32_t call_id) {
    const Verdict verdict = server_.on_frame(peer_.call_frame(call_id), peer_.address, at(0s));
    if (verdict.action == Action::kDispatch) {
      ASSERT_TRUE(run_.insert(call_id).second) << "a call was run twice";
      ASSERT_FALSE(refused_.contains(call_id)) << "a call was run after it was refused";
      running_[call_id] = verdict.request;
      return;
    }
    if (verdict.action != Action::kSend) return;
    const Header header = header_of(verdict.frame);
    ASSERT_EQ(header.call_id, call_id);
    if (header.kind == FrameKind::kRefuse) {
      ASSERT_EQ(header.status, Status::kOverload);
      ASSERT_FALSE(run_.contains(call_id)) << "a call was refused after it was run";
      refused_.insert(call_id);
      return;
    }
    ASSERT_TRUE(replies_.contains(call_id)) << "a call was answered that did not end";
    ASSERT_EQ(payload_of(verdict.frame), replies_[call_id]);
  }

  Random random_;
  ServerSessions server_{server_config()};
  Peer peer_;
  std::uint32_t next_call_ = 0;
  std::set<std::uint32_t> run_;
  std::set<std::uint32_t> refused_;
  std::map<std::uint32_t, Request> running_;
  std::map<std::uint32_t, Bytes> replies_;
};

TEST(ServerCallsProperty, RunAtMostOnceAndKeepTheirAnswer) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    CallHistory history(seed);
    for (int step = 0; step < 300 && !testing::Test::HasFatalFailure(); ++step)
      history.step();
    EXPECT_GT(history.run_count(), 10u);
    if (testing::Test::HasFailure()) return;
  }
}

}  // namespace
}  // namespace rtpm::wire
