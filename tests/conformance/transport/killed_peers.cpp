#include <sys/mman.h>

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/status.hpp"
#include "suite.hpp"
#include "victim.hpp"

// Callers of a server whose process is killed or stopped, above all callers of oneways, which have
// no answer.
namespace rtpm::rpc::test {
namespace {

using namespace std::chrono_literals;

constexpr MethodDescriptor kNote{1, "note", 401, false, {}};
constexpr MethodDescriptor kPing{2, "ping", 402, true, {}};
constexpr MethodDescriptor kTicks{3, "ticks", 403, false, {}};
constexpr std::array kMethods{kNote, kPing, kTicks};
constexpr InterfaceDescriptor kInterface{"test.Killed", 4714, "by hand", kMethods};

/// Memory shared by the test and the processes that it forks.
class SharedCount {
 public:
  SharedCount()
      : memory_(mmap(nullptr, sizeof(std::atomic<int>), PROT_READ | PROT_WRITE,
                     MAP_SHARED | MAP_ANONYMOUS, -1, 0)),
        count_(new (memory_) std::atomic<int>(0)) {}
  SharedCount(const SharedCount&) = delete;
  SharedCount& operator=(const SharedCount&) = delete;
  ~SharedCount() { munmap(memory_, sizeof(std::atomic<int>)); }
  [[nodiscard]] std::atomic<int>& value() const noexcept { return *count_; }

 private:
  void* memory_;
  std::atomic<int>* count_;
};

/// Counts the notes in memory shared with the test, and begins a stream that never has an item.
class CountingServant final : public Servant {
 public:
  explicit CountingServant(std::atomic<int>& count) : count_(count) {}
  const InterfaceDescriptor& interface() const noexcept override { return kInterface; }
  DispatchResult dispatch(std::uint16_t method_id, ConstBytes, MutableBytes,
                          const CallContext& context) override {
    if (method_id == kNote.id) count_.fetch_add(1);
    if (method_id == kTicks.id) {
      const rt::AllowAllocationScope is_allowed;
      writer_ = context.deferral->stream();
    }
    return {};
  }

 private:
  std::atomic<int>& count_;
  ItemWriter writer_;
};

/// A server of that servant.
struct CountingServer {
  CountingServer(std::atomic<int>& count, std::uint16_t port) : servant(count) {
    ServerConfig config = quiet_config();
    config.port = port;
    auto created = Server::create(std::move(config));
    if (!created) return;
    server = std::move(*created);
    if (!server->add("notes", servant) || !server->start()) server.reset();
  }
  ~CountingServer() {
    if (server) server->stop();
  }
  CountingServer(const CountingServer&) = delete;
  CountingServer& operator=(const CountingServer&) = delete;

  CountingServant servant;
  std::unique_ptr<Server> server;
};

class KilledPeers : public TransportSuite {
 protected:
  void SetUp() override {
    TransportSuite::SetUp();
    port_ = victim_.await_number();
    ASSERT_NE(port_, 0);
    binding_.emplace(bind());
  }
  [[nodiscard]] Binding bind() {
    auto bound =
        Binding::bind(node_, "rtpm://127.0.0.1:" + std::to_string(port_) + "/notes", kInterface,
                      {.deadline = rtpm::test::kPatience, .warm_up = {Priority{0}}});
    EXPECT_TRUE(bound) << bound.error().text();
    return std::move(*bound);
  }
  static expected<void, CallError> note(Binding& binding, std::size_t size = 8) {
    static const Bytes payload(wire::kSharedPayloadSizeMax);
    return binding.send(kNote, ConstBytes(payload).first(size), wire::Delivery::kSent);
  }
  /// Sends until one is refused; returns the number of those before it.
  int note_until_refused(CallError& error, std::size_t size = 8) {
    for (int count = 0;; ++count) {
      const auto sent = note(*binding_, size);
      if (sent) continue;
      error = sent.error();
      return count;
    }
  }
  /// Stops the server, so that it reads nothing from here on, and sends `count` oneways.
  void note_unread(int count) {
    ASSERT_TRUE(binding_->call(kPing, {}));
    victim_.stop();
    for (int i = 0; i < count; ++i)
      ASSERT_TRUE(note(*binding_));
  }

  SharedCount arrived_;
  Victim victim_{[this](const auto& tell) {
    const CountingServer server(arrived_.value(), 0);
    tell(server.server ? server.server->port() : 0);
    while (true)
      pause();
  }};
  std::uint16_t port_ = 0;
  Node node_{node_config()};
  std::optional<Binding> binding_;
};

INSTANTIATE_TEST_SUITE_P(Udp, KilledPeers, testing::Values(Transport::kUdp));
INSTANTIATE_TEST_SUITE_P(Tcp, KilledPeers, testing::Values(Transport::kTcp));
INSTANTIATE_TEST_SUITE_P(SharedMemory, KilledPeers, testing::Values(Transport::kSharedMemory));

TEST_P(KilledPeers, FailTheNextOnewayWithTheCountOfThoseNotConfirmed) {
  std::thread killer([&] {
    EXPECT_TRUE(await([&] { return arrived_.value() >= 100; }));
    victim_.kill();
  });
  CallError error{};
  const int sent = note_until_refused(error);
  killer.join();
  EXPECT_EQ(error, CallError::kMaybeLost) << to_string(error);
  const int arrived = arrived_.value();
  const auto lost = static_cast<int>(binding_->lost_oneway_count());
  // A lane of several threads has read requests that it has not begun.
  if (buffered_requests() == 0 || transport() != Transport::kSharedMemory) {
    EXPECT_LE(sent, arrived + lost) << "each that was sent arrived, or is told as maybe lost";
  }
  if (transport() == Transport::kSharedMemory) {
    EXPECT_GE(sent, arrived + lost - 1) << "the ring tells, but for the one that was read last";
  }
  const auto next = note(*binding_);
  ASSERT_FALSE(next);
  EXPECT_EQ(next.error(), CallError::kUnreachable) << to_string(next.error());
}

TEST_P(KilledPeers, AreReportedWithTheExactCountOfUnreadOneways) {
  note_unread(100);
  victim_.kill();
  CallError error{};
  const int more = note_until_refused(error);
  EXPECT_EQ(error, CallError::kMaybeLost) << to_string(error);
  EXPECT_EQ(binding_->lost_oneway_count(), 100U + static_cast<unsigned>(more));
  if (!is_udp()) {
    EXPECT_LE(more, 1) << "the system knows that the peer is gone";
  }
  EXPECT_EQ(arrived_.value(), 0);
}

TEST_P(KilledPeers, AreReplacedAndTheNextOnewayArrives) {
  note_unread(10);
  victim_.kill();
  const CountingServer next(arrived_.value(), port_);
  ASSERT_TRUE(next.server);
  CallError error{};
  const int lost = note_until_refused(error);
  EXPECT_EQ(error, CallError::kMaybeLost) << to_string(error);
  EXPECT_EQ(binding_->lost_oneway_count(), 10U + static_cast<unsigned>(lost));
  EXPECT_EQ(arrived_.value(), 0);
  ASSERT_TRUE(note(*binding_)) << "it is told once";
  EXPECT_TRUE(await([&] { return arrived_.value() == 1; }));
}

TEST_P(KilledPeers, CostNothingIfTheyConfirmedAll) {
  ASSERT_TRUE(note(*binding_));
  ASSERT_TRUE(binding_->call(kPing, {}));
  victim_.kill();
  const CountingServer next(arrived_.value(), port_);
  ASSERT_TRUE(next.server);
  CallError error{};
  int more = 0;
  EXPECT_TRUE(await([&] {
    const auto sent = note(*binding_);
    if (!sent) error = sent.error();
    return !sent || ++more == 10;
  }));
  // Over UDP the first one meets a server that does not know the session.
  EXPECT_EQ(binding_->lost_oneway_count(), is_udp() ? static_cast<unsigned>(more) : 0U);
  if (!is_udp()) {
    EXPECT_EQ(more, 10) << to_string(error);
    EXPECT_TRUE(await([&] { return arrived_.value() == 11; }));
  }
}

TEST_P(KilledPeers, AreReportedToTheSenderEvenIfAnotherCallerDetectsThem) {
  Binding other = bind();
  note_unread(10);
  victim_.kill();
  const auto call = other.call(kPing, {});
  ASSERT_FALSE(call);
  EXPECT_EQ(call.error(), CallError::kUnreachable) << to_string(call.error());
  const auto told = note(*binding_);
  ASSERT_FALSE(told);
  EXPECT_EQ(told.error(), CallError::kMaybeLost) << to_string(told.error());
  EXPECT_EQ(binding_->lost_oneway_count(), 10U);
  const auto innocent = note(other);
  ASSERT_FALSE(innocent);
  EXPECT_EQ(innocent.error(), CallError::kUnreachable) << "it had sent none";
}

TEST_P(KilledPeers, AreFoundByACheckThatSendsNothing) {
  note_unread(1);
  EXPECT_TRUE(binding_->check_oneways());
  victim_.kill();
  const auto told = binding_->check_oneways();
  if (is_udp()) {
    EXPECT_TRUE(told) << "no datagram is on its way that could be refused";
    return;
  }
  ASSERT_FALSE(told);
  EXPECT_EQ(told.error(), CallError::kMaybeLost);
  EXPECT_EQ(binding_->lost_oneway_count(), 1U);
  EXPECT_TRUE(binding_->check_oneways()) << "it is told once";
}

// The kernel drops datagrams to a stopped server, and no side reports it.
TEST_P(KilledPeers, RefuseOnewaysWhenFullWhileOnlyStopped) {
  if (is_udp()) GTEST_SKIP() << "UDP tells nothing";
  note_unread(1);
  CallError error{};
  const int sent = note_until_refused(error, 8000);
  EXPECT_EQ(error, CallError::kMaybeLost) << to_string(error);
  EXPECT_EQ(binding_->lost_oneway_count(), 1U + static_cast<unsigned>(sent));
  victim_.go_on();
  EXPECT_TRUE(note(*binding_));
  EXPECT_TRUE(await([&] { return arrived_.value() > 0; }));
}

TEST_P(KilledPeers, EndStreamsThatWait) {
  auto stream = binding_->open_stream(kTicks, {});
  ASSERT_TRUE(stream) << to_string(stream.error());
  const auto nothing = stream->next(rt::now() + 10ms);
  ASSERT_FALSE(nothing);
  EXPECT_EQ(nothing.error(), CallError::kTimeout);
  ASSERT_TRUE(stream->is_open());
  std::thread killer([&] { victim_.kill(); });
  const MonotonicTime patience = rt::now() + rtpm::test::kPatience;
  const auto item = stream->next(patience);
  killer.join();
  ASSERT_FALSE(item);
  EXPECT_EQ(item.error(), CallError::kDisconnected) << to_string(item.error());
  EXPECT_FALSE(stream->is_open());
}

TEST_P(KilledPeers, EndStreamsAndCallsByTimeWhileOnlyStopped) {
  auto stream = binding_->open_stream(kTicks, {}, {.miss_count_max = kMissCountMin});
  ASSERT_TRUE(stream) << to_string(stream.error());
  victim_.stop();
  const auto call = binding_->call(kPing, {}, {.deadline = 50ms});
  ASSERT_FALSE(call);
  // The call takes a further connection, which a stopped server does not give.
  EXPECT_TRUE(call.error() == CallError::kTimeout || call.error() == CallError::kUnreachable)
      << to_string(call.error());
  const auto item = stream->next(rt::now() + rtpm::test::kPatience);
  ASSERT_FALSE(item);
  EXPECT_EQ(item.error(), CallError::kTimeout) << to_string(item.error());
  EXPECT_FALSE(stream->is_open());
  victim_.go_on();
  EXPECT_TRUE(binding_->call(kPing, {}));
}

}  // namespace
}  // namespace rtpm::rpc::test
