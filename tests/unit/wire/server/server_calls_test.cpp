#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
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

/// Expects that `verdict` answers the call of `peer` with `status`, without running it.
void expect_not_run(const Verdict& verdict, const Peer& peer, std::uint32_t call_id,
                    Status status) {
  ASSERT_EQ(verdict.action, Action::kSend);
  ASSERT_EQ(verdict.frame.size(), kHeaderSize);
  const Header header = header_of(verdict.frame);
  EXPECT_EQ(header.kind, FrameKind::kReply);
  EXPECT_EQ(header.status, status);
  EXPECT_EQ(header.session, peer.session);
  EXPECT_EQ(header.call_id, call_id);
}

TEST_F(ServerCalls, AreDispatchedWithAllThatTheyCarry) {
  const Bytes frame = peer_.call_frame(1, "request 1");
  const Verdict verdict = receive(frame, at(5ms));
  ASSERT_EQ(verdict.action, Action::kDispatch);
  const Request& request = verdict.request;
  EXPECT_EQ(request.header.call_id, 1u);
  EXPECT_EQ(request.header.service, 3u);
  EXPECT_EQ(request.header.method, 4u);
  EXPECT_EQ(request.header.trace_id, 0x7aceu);
  EXPECT_EQ(request.header.priority, peer_.priority);
  EXPECT_EQ(copy_of(request.payload), bytes_of("request 1"));
  EXPECT_EQ(request.received, at(5ms));
  EXPECT_EQ(request.deadline, at(5ms) + 1s);
}

// hp-5.1-2
TEST_F(ServerCalls, AreAnsweredUnderTheirOwnNumbers) {
  const Verdict verdict = call(1, at(5ms));
  ASSERT_EQ(verdict.action, Action::kDispatch);
  const Bytes reply =
      answer(server_, verdict.request, "result", at(5ms + 250us), Status::kServantFailed);
  const Header header = header_of(reply);
  EXPECT_EQ(header.kind, FrameKind::kReply);
  EXPECT_EQ(header.status, Status::kServantFailed);
  EXPECT_EQ(header.session, peer_.session);
  EXPECT_EQ(header.call_id, 1u);
  EXPECT_EQ(header.service, 3u);
  EXPECT_EQ(header.method, 4u);
  EXPECT_EQ(header.priority, peer_.priority);
  EXPECT_EQ(header.trace_id, 0x7aceu);
  EXPECT_EQ(header.flags, 0u);
  EXPECT_EQ(header.budget_us, 250u) << "the time that the server took";
  EXPECT_EQ(header.sender_time_ns, static_cast<std::uint64_t>(to_ns(at(5ms + 250us))));
  EXPECT_EQ(payload_of(reply), bytes_of("result"));
}

// hp-5.2-1
TEST_F(ServerCalls, ThatEndedAreAnsweredAgainWithTheSameBytes) {
  const Bytes reply = call_and_answer(1);
  for (int copy = 1; copy <= 3; ++copy) {
    const Verdict again = call(1, at(copy * 1s));
    ASSERT_EQ(again.action, Action::kSend);
    Bytes expected = reply;
    store_le(expected.data() + 6, kFlagRepeated);
    EXPECT_EQ(copy_of(again.frame), expected) << "but for the repeated flag";
    EXPECT_EQ(server_.counters().duplicate_answered_count, static_cast<std::uint64_t>(copy));
  }
}

// hp-5.2-1
TEST_F(ServerCalls, ThatRunAreNotRunAgain) {
  const Verdict first = call(1);
  ASSERT_EQ(first.action, Action::kDispatch);
  EXPECT_EQ(call(1).action, Action::kNothing);
  EXPECT_EQ(dropped(DropReason::kDuplicateRunning), 1u);
  EXPECT_EQ(payload_of(answer(server_, first.request, "late", at(1s))), bytes_of("late"));
  EXPECT_EQ(call(1).action, Action::kSend);
}

// hp-5.2-2
TEST_F(ServerCalls, ThatTheirSessionLeftBehindAreDropped) {
  for (std::uint32_t call_id = 1; call_id <= 2 * kCallWindow; ++call_id)
    call_and_answer(call_id);
  for (std::uint32_t call_id = 1; call_id <= kCallWindow; ++call_id) {
    EXPECT_EQ(call(call_id).action, Action::kNothing);
  }
  EXPECT_EQ(dropped(DropReason::kStaleCall), kCallWindow);
  for (std::uint32_t call_id = kCallWindow + 1; call_id <= 2 * kCallWindow; ++call_id) {
    EXPECT_EQ(call(call_id).action, Action::kSend) << "the last of the window are remembered";
  }
}

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

TEST_F(ServerCalls, OfOneWindowMayBeOpenAtATimeAndEndInAnyOrder) {
  std::vector<Request> open;
  for (std::uint32_t call_id = 1; call_id <= kCallWindow; ++call_id) {
    const Verdict verdict = call(call_id);
    ASSERT_EQ(verdict.action, Action::kDispatch);
    open.push_back(verdict.request);
  }
  std::ranges::reverse(open);
  for (const Request& request : open) {
    const std::string text = "for " + std::to_string(request.header.call_id);
    const Bytes reply = answer(server_, request, text, at(1s));
    EXPECT_EQ(header_of(reply).call_id, request.header.call_id);
  }
  for (std::uint32_t call_id = 1; call_id <= kCallWindow; ++call_id) {
    const Verdict again = call(call_id);
    EXPECT_EQ(payload_of(again.frame), bytes_of("for " + std::to_string(call_id)));
  }
}

// hp-5.2-3
TEST_F(ServerCalls, BeyondTheWindowAreRefusedWithOverload) {
  const Verdict first = call(1);
  const Verdict beyond = call(1 + kCallWindow);
  ASSERT_EQ(beyond.action, Action::kSend);
  const Header header = header_of(beyond.frame);
  EXPECT_EQ(header.kind, FrameKind::kRefuse);
  EXPECT_EQ(header.status, Status::kOverload);
  EXPECT_EQ(header.session, peer_.session);
  EXPECT_EQ(header.call_id, 1u + kCallWindow);
  EXPECT_EQ(payload_of(answer(server_, first.request, "first", at(0s))), bytes_of("first"));
}

// Overload promises that the call did not run: a later copy must not run, either.
TEST_F(ServerCalls, BeyondTheWindowAreNeverRunOnceRefused) {
  const Verdict first = call(1);
  ASSERT_EQ(call(1 + kCallWindow).action, Action::kSend);
  EXPECT_EQ(call(1).action, Action::kNothing) << "the first runs still";
  Verdict copy = call(1 + kCallWindow);
  ASSERT_EQ(copy.action, Action::kSend);
  EXPECT_EQ(header_of(copy.frame).status, Status::kOverload);
  static_cast<void>(answer(server_, first.request, "first", at(0s)));
  copy = call(1 + kCallWindow);
  ASSERT_EQ(copy.action, Action::kSend) << "now there is room, but it was refused";
  EXPECT_EQ(header_of(copy.frame).status, Status::kOverload);
  EXPECT_EQ(call(1 + 2 * kCallWindow).action, Action::kDispatch) << "the next one is run";
}

// hp-4.4-1
TEST_F(ServerCalls, OfAnUnknownSessionAreRefusedSoThatTheClientSees) {
  Peer stranger = peer_;
  for (const std::uint64_t session : {std::uint64_t{0}, peer_.session + 1, peer_.session ^ 1 << 20,
                                      ~std::uint64_t{0}, std::uint64_t{0xffff}}) {
    stranger.session = session;
    const Verdict verdict = receive(stranger.call_frame(7, "payload"));
    ASSERT_EQ(verdict.action, Action::kSend);
    EXPECT_EQ(verdict.frame.size(), kHeaderSize);
    const Header header = header_of(verdict.frame);
    EXPECT_EQ(header.kind, FrameKind::kRefuse);
    EXPECT_EQ(header.status, Status::kUnknownSession);
    EXPECT_EQ(header.session, session);
    EXPECT_EQ(header.call_id, 7u);
    EXPECT_EQ(header.priority, peer_.priority);
  }
  EXPECT_EQ(dropped(DropReason::kUnknownSession), 5u);
}

// hp-5.1-4
TEST_F(ServerCalls, FromAnotherAddressAreDropped) {
  PeerAddress stranger = peer_.address;
  stranger.port ^= 1;
  const Verdict verdict = server_.on_frame(peer_.call_frame(1), stranger, at(0s));
  EXPECT_EQ(verdict.action, Action::kNothing);
  EXPECT_EQ(dropped(DropReason::kForeignAddress), 1u);
  EXPECT_EQ(call(1).action, Action::kDispatch) << "the session's own address goes on";
}

// hp-5.1-5
TEST_F(ServerCalls, OutsideTheBandAreRefused) {
  ServerSessionsConfig config = server_config();
  config.band = {100, 200};
  ServerSessions server(config);
  peer_.open(server, at(0s));
  std::uint32_t call_id = 0;
  for (const int priority : {99, 201, 0, Priority::kHighest}) {
    peer_.priority = priority;
    const Bytes frame = peer_.call_frame(++call_id);
    expect_not_run(server.on_frame(frame, peer_.address, at(0s)), peer_, call_id,
                   Status::kWrongBand);
    expect_not_run(server.on_frame(frame, peer_.address, at(0s)), peer_, call_id,
                   Status::kWrongBand);
  }
  EXPECT_EQ(server.counters().refused_count, 4u) << "copies are answered from the cache";
  peer_.priority = 200;
  EXPECT_EQ(server.on_frame(peer_.call_frame(++call_id), peer_.address, at(0s)).action,
            Action::kDispatch);
}

// hp-5.1-5
TEST_F(ServerCalls, AboveTheCeilingAreRefused) {
  ServerSessionsConfig config = server_config();
  config.ceiling = 150;
  ServerSessions server(config);
  peer_.priority = 20'000;
  EXPECT_EQ(peer_.open(server, at(0s)).kind, FrameKind::kWelcome) << "the band has the priority";
  peer_.priority = 150;
  EXPECT_EQ(server.on_frame(peer_.call_frame(1), peer_.address, at(0s)).action, Action::kDispatch);
  peer_.priority = 151;
  expect_not_run(server.on_frame(peer_.call_frame(2), peer_.address, at(0s)), peer_, 2,
                 Status::kPriorityNotAllowed);
}

// hp-6.2-1
TEST_F(ServerCalls, AboveTheCeilingAreTakenIfTheyArePings) {
  ServerSessionsConfig config = server_config();
  config.ceiling = 150;
  ServerSessions server(config);
  peer_.open(server, at(0s));
  std::uint32_t call_id = 0;
  for (const std::uint16_t method : {kMethodBind, kMethodPing, kMethodDescribe}) {
    Header header = peer_.call_header(++call_id);
    header.service = kSessionService;
    header.method = method;
    header.priority = 151;
    const Verdict verdict = server.on_frame(frame_of(header), peer_.address, at(0s));
    EXPECT_EQ(verdict.action == Action::kDispatch, method == kMethodPing) << method;
  }
  Header other = peer_.call_header(++call_id);
  other.method = kMethodPing;
  other.priority = 151;
  EXPECT_EQ(server.on_frame(frame_of(other), peer_.address, at(0s)).action, Action::kSend)
      << "an object's method 2 is no ping";
}

// hp-2-6: this holds even if the message would fit.
TEST_F(ServerCalls, InADatagramThatIsTooLargeAreDropped) {
  std::array<std::byte, 4 * 4096> memory{};
  ServerSessionsConfig config = server_config();
  config.message_size_max = 4096;
  config.large_memory = memory;
  ServerSessions server(config);
  peer_.open(server, at(0s));
  const std::string largest(kDatagramPayloadSizeMax, 'x');
  EXPECT_EQ(server.on_frame(peer_.call_frame(1, largest), peer_.address, at(0s)).action,
            Action::kDispatch);
  EXPECT_EQ(server.on_frame(peer_.call_frame(2, largest + 'x'), peer_.address, at(0s)).action,
            Action::kNothing);
  EXPECT_EQ(server.counters().dropped_for(DropReason::kBadLength), 1u);
}

// hp-5.1-5
TEST_F(ServerCalls, LargerThanTheLimitAreRefused) {
  const std::string largest(kDatagramPayloadSizeMax, 'x');
  EXPECT_EQ(receive(peer_.call_frame(1, largest)).action, Action::kDispatch);

  ServerSessionsConfig config = server_config(Medium::kStream);
  config.message_size_max = 5000;
  ServerSessions server(config);
  peer_.open(server, at(0s), Medium::kStream);
  EXPECT_EQ(
      server.on_frame(peer_.call_frame(1, std::string(5000, 'x')), peer_.address, at(0s)).action,
      Action::kDispatch);
  expect_not_run(
      server.on_frame(peer_.call_frame(2, std::string(5001, 'x')), peer_.address, at(0s)), peer_, 2,
      Status::kTooLarge);
}

TEST_F(ServerCalls, GetABufferForWhatTheirClientTakes) {
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

// hp-5.4-3
TEST_F(ServerCalls, WithoutTimeLeftAreNotRun) {
  Header header = peer_.call_header(1);
  header.budget_us = 0;
  expect_not_run(receive(frame_of(header)), peer_, 1, Status::kExpired);
  EXPECT_EQ(server_.counters().expired_count, 1u);
  EXPECT_EQ(server_.counters().refused_count, 0u) << "counted once";
  header = peer_.call_header(2);
  header.budget_us = 1;
  EXPECT_EQ(receive(frame_of(header)).action, Action::kDispatch);
}

/// The deadline of a call with a budget of 100 µs that is sent at `sent` on the client's clock and
/// received at `received`; nullopt if it has expired.
std::optional<MonotonicTime> deadline_of(std::uint64_t client_clock, std::uint64_t server_clock,
                                         MonotonicTime sent, MonotonicTime received) {
  ServerSessionsConfig config = server_config();
  config.clock_domain = server_clock;
  ServerSessions server(config);
  Peer peer;
  peer.clock_domain = client_clock;
  peer.open(server, received);
  Header header = peer.call_header(1);
  header.budget_us = 100;
  header.sender_time_ns = static_cast<std::uint64_t>(to_ns(sent));
  const Verdict verdict = server.on_frame(frame_of(header), peer.address, received);
  if (verdict.action == Action::kDispatch) return verdict.request.deadline;
  EXPECT_EQ(header_of(verdict.frame).status, Status::kExpired);
  return std::nullopt;
}

// hp-5.4-2
TEST(ServerDeadline, CountsTheTimeInASocketWhereBothSidesReadOneClock) {
  EXPECT_EQ(deadline_of(7, 7, at(0us), at(0us)), at(100us));
  EXPECT_EQ(deadline_of(7, 7, at(0us), at(99us)), at(100us));
  EXPECT_EQ(deadline_of(7, 7, at(0us), at(100us)), std::nullopt);
  EXPECT_EQ(deadline_of(7, 7, at(0us), at(3s)), std::nullopt);
}

TEST(ServerDeadline, CountsFromArrivalWhereClocksDiffer) {
  EXPECT_EQ(deadline_of(7, 8, at(0us), at(3s)), at(3s + 100us));
  EXPECT_EQ(deadline_of(0, 0, at(0us), at(3s)), at(3s + 100us)) << "0: not known";
  EXPECT_EQ(deadline_of(7, 0, at(0us), at(3s)), at(3s + 100us));
}

TEST(ServerDeadline, DoesNotBelieveASenderFromTheFuture) {
  EXPECT_EQ(deadline_of(7, 7, at(1us), at(0us)), at(100us));
  EXPECT_EQ(deadline_of(7, 7, at(24h), at(0us)), at(100us));
  EXPECT_EQ(deadline_of(7, 7, time_from_ns(-1), at(0us)), at(100us)) << "the largest number";
}

TEST(ServerDeadline, HoldsForTheLargestBudget) {
  ServerSessions server(server_config());
  Peer peer;
  peer.open(server, at(0s));
  Header header = peer.call_header(1);
  header.budget_us = ~std::uint32_t{0};
  const Verdict verdict = server.on_frame(frame_of(header), peer.address, at(0s));
  ASSERT_EQ(verdict.action, Action::kDispatch);
  EXPECT_EQ(verdict.request.deadline, at(std::chrono::microseconds{~std::uint32_t{0}}));
}

// hp-5.3-4: a stream needs no repetition, so a copy is the client's fault.
TEST(ServerStream, DropsCopies) {
  ServerSessions server(server_config(Medium::kStream));
  Peer peer;
  peer.open(server, at(0s), Medium::kStream);
  const Verdict first = server.on_frame(peer.call_frame(1), peer.address, at(0s));
  ASSERT_EQ(first.action, Action::kDispatch);
  static_cast<void>(answer(server, first.request, "", at(0s)));
  EXPECT_EQ(server.on_frame(peer.call_frame(1), peer.address, at(0s)).action, Action::kNothing);
  EXPECT_EQ(server.counters().dropped_for(DropReason::kStaleCall), 1u);
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

TEST(ServerCallsProperty, EachRunsAtMostOnceAndIsAnsweredAlike) {
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
