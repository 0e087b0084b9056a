#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <tuple>

#include "rtpm/access/fingerprint.hpp"
#include "rtpm/rpc/tables.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/alloc_guard.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/lock_guard.hpp"
#include "rtpm/test/sealed_peer.hpp"
#include "rtpm/test/serve.hpp"
#include "secured_server.hpp"

// A call allocates nothing on either side: each lane, and here the caller, runs in a
// NoAllocationScope, and the guard that this binary links aborts on any breach. The guard for locks
// aborts, too: every lock taken here must have priority inheritance.
namespace rtpm::rpc {
namespace {

using namespace test;

struct Wrench {
  std::array<double, 6> values{};
};

constexpr int kCallCount = 1000;

class NoAllocation : public testing::TestWithParam<std::tuple<Transport, rt::WaitStrategy>> {
 protected:
  void SetUp() override {
    if (!rtpm::test::is_alloc_guard_active()) GTEST_SKIP() << rtpm::test::kAllocGuardInactive;
  }
  [[nodiscard]] static Transport transport() { return std::get<0>(GetParam()); }
  [[nodiscard]] static rt::WaitStrategy wait() { return std::get<1>(GetParam()); }
  static ServerConfig server_config() {
    LaneConfig low = quiet_lane();
    low.wait.strategy = wait();
    LaneConfig high = low;
    high.low = 20'000;
    return quiet_config({low, high});
  }
  static NodeConfig node_config() {
    NodeConfig config = quiet_node(transport());
    config.wait.strategy = wait();
    return config;
  }
  /// Calls with a bare struct, there and back; returns how many calls failed.
  static int call_many(Binding& binding, const CallOptions& options) {
    int failure_count = 0;
    const rt::NoAllocationScope no_allocation;
    for (int i = 0; i < kCallCount; ++i) {
      Wrench wrench;
      wrench.values.fill(i);
      const auto reply =
          call_for_struct<Wrench>(binding, echo::kEcho, struct_bytes(wrench), options);
      if (!reply || reply->values != wrench.values) ++failure_count;
    }
    return failure_count;
  }
};

INSTANTIATE_TEST_SUITE_P(
    All, NoAllocation,
    testing::Combine(testing::Values(Transport::kUdp, Transport::kTcp, Transport::kSharedMemory,
                                     Transport::kLocal),
                     testing::Values(rt::WaitStrategy::kAdaptive, rt::WaitStrategy::kBlock,
                                     rt::WaitStrategy::kSpin)),
    [](const auto& row) {
      return std::string(to_string(std::get<0>(row.param))) + "_" +
             std::string(to_string(std::get<1>(row.param)));
    });

TEST_P(NoAllocation, InAThousandCalls) {
  EchoServer server(server_config());
  Node node(node_config());
  // Allocation-free from the first call on, because the bind opened the bands.
  Binding binding = bind_echo(node, server, {.warm_up = {100, 25'000}});
  EXPECT_EQ(call_many(binding, {.priority = 100}), 0);
  EXPECT_EQ(call_many(binding, {.priority = 25'000}), 0);
  EXPECT_EQ(server.servant.run_count(), 2 * kCallCount);
}

TEST_P(NoAllocation, InAThousandOneways) {
  EchoServer server(server_config());
  Node node(node_config());
  Binding binding = bind_echo(node, server, {.warm_up = {100}});
  int sent_count = 0;
  {
    const rt::NoAllocationScope no_allocation;
    for (int i = 0; i < kCallCount; ++i) {
      const auto sent = binding.send(echo::kEcho, {}, wire::Delivery::kSent, {.priority = 100});
      sent_count += sent ? 1 : 0;
      // A oneway that is sent faster than it runs may be refused or lost.
      if (i % 16 == 0) static_cast<void>(binding.call(echo::kEcho, {}, {.priority = 100}));
    }
  }
  EXPECT_EQ(sent_count, kCallCount);
}

TEST_P(NoAllocation, InCallsThatFail) {
  ServerConfig config = server_config();
  config.message_size_max = 2000;
  EchoServer server(config);
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  const MethodDescriptor unknown{77, "unknown", 1, false, {}};
  const std::array refusal{static_cast<std::byte>(Refusal::kNotLeaseHolder)};
  const Bytes too_large((16 << 20) + 1);
  std::array<CallError, 3> errors{};
  {
    const rt::NoAllocationScope no_allocation;
    errors[0] = binding.call(unknown, {}).error();
    errors[1] = binding.call(echo::kRefuse, refusal).error();
    errors[2] = binding.call(echo::kEcho, too_large).error();
  }
  EXPECT_EQ(errors, (std::array{CallError::kNoSuchMethod, CallError::kNotLeaseHolder,
                                CallError::kTooLarge}));
}

// The server looks up, caches and denies rights, and writes them to the audit log.
TEST_P(NoAllocation, InCallsToASecuredServer) {
  const bool is_sealed = transport() == Transport::kUdp || transport() == Transport::kTcp;
  const KeyFolder folder;
  NodeConfig client = node_config();
  client.security = {.key_file = folder.file("node"),
                     .known_servers_file = folder.file("known_servers")};
  const std::string caller =
      is_sealed ? access::public_key_text(access::make_key(folder.file("node"), "node")->public_key)
                : own_user();
  ServerConfig config = server_config();
  config.security.audit_file = folder.file("audit");
  SecuredServer secured(folder, caller + " name=me role=configure on=lab/*\n", {"lab/arm0"},
                        config);
  folder.write("known_servers",
               "127.0.0.1 " + access::public_key_text(*secured.server->public_key()) + "\n");
  Node node(client);
  auto binding = Binding::bind(node, secured.server->url("lab/arm0"), vault::kInterface);
  ASSERT_TRUE(binding) << binding.error().text();
  int failure_count = 0;
  {
    const rt::NoAllocationScope no_allocation;
    for (int i = 0; i < kCallCount; ++i) {
      const bool is_good = binding->call(vault::kTune, {}) && !binding->call(vault::kReset, {});
      failure_count += is_good ? 0 : 1;
    }
  }
  EXPECT_EQ(failure_count, 0);
  EXPECT_EQ(secured.vaults[0]->name(), "me");
}

TEST_P(NoAllocation, OnSeveralThreads) {
  EchoServer server(server_config());
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  {
    // Two channels, one for each thread.
    const auto first = binding.call(echo::kEcho, {});
    const auto second = binding.call(echo::kEcho, {});
    ASSERT_TRUE(first && second);
  }
  std::thread other([&] { EXPECT_EQ(call_many(binding, {}), 0); });
  EXPECT_EQ(call_many(binding, {}), 0);
  other.join();
}

// Checks the check: it detects a servant that allocates on the lane's thread.
TEST_P(NoAllocation, IsBrokenByAServantThatAllocates) {
  EchoServer server(server_config());
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  const rtpm::test::CountBreachesOnly count_only;
  const auto before = rtpm::test::allocation_breach_count();
  EXPECT_TRUE(binding.call(echo::kAllocate, {}));
  EXPECT_EQ(rtpm::test::allocation_breach_count() - before, 2u) << "one block, allocated and freed";
}

/// A servant that takes an ordinary lock.
class LockingServant final : public Servant {
 public:
  [[nodiscard]] const InterfaceDescriptor& interface() const noexcept override {
    return echo::kInterface;
  }
  DispatchResult dispatch(std::uint16_t, ConstBytes, MutableBytes, const CallContext&) override {
    const std::lock_guard lock(mutex_);
    return {wire::Status::kOk, 0};
  }

 private:
  std::mutex mutex_;
};

/// Answers with a stream, which the test feeds.
class StreamingServant final : public Servant {
 public:
  [[nodiscard]] const InterfaceDescriptor& interface() const noexcept override {
    return echo::kInterface;
  }
  DispatchResult dispatch(std::uint16_t, ConstBytes, MutableBytes,
                          const CallContext& context) override {
    writer = context.deferral->stream();
    if (!writer) return {wire::Status::kOverload, 0};
    has_writer = true;
    return {};
  }
  ItemWriter writer{};
  std::atomic<bool> has_writer{false};
};

TEST_P(NoAllocation, WithStreamsOfLargeItems) {
  StreamingServant servant;
  ServerConfig config = server_config();
  // Every call that the lane accepts is a stream that waits for its turn.
  config.deferred_call_count_max = 1;
  const auto server = rtpm::test::serve("echo", servant, config);
  Node node(node_config());
  auto binding = Binding::bind(node, server->url("echo"), echo::kInterface,
                               {.deadline = rtpm::test::kPatience});
  ASSERT_TRUE(binding) << binding.error().text();
  auto reader = binding->open_stream(echo::kEcho, {});
  ASSERT_TRUE(reader);
  ASSERT_TRUE(await([&] { return servant.has_writer.load(); }));
  const Bytes item(200'000, std::byte{7});
  constexpr int kItemCount = 20;
  int good_count = 0;
  std::thread producer([&] {
    const rt::NoAllocationScope no_allocation;
    for (int i = 0; i < kItemCount; ++i) {
      while (!servant.writer.write(item))
        std::this_thread::yield();
    }
    servant.writer.finish();
  });
  {
    const rt::NoAllocationScope no_allocation;
    while (true) {
      const auto got = reader->next(rt::now() + rtpm::test::kPatience);
      if (!got || !*got) break;
      if (std::ranges::equal(**got, item)) ++good_count;
    }
  }
  producer.join();
  EXPECT_EQ(good_count, kItemCount);
  server->stop();
}

TEST(NoLock, IsBrokenByAServantThatTakesOneWithoutInheritance) {
  if (!rtpm::test::is_lock_guard_active()) GTEST_SKIP() << rtpm::test::kLockGuardInactive;
  LockingServant servant;
  const auto server = rtpm::test::serve("lock", servant, quiet_config());
  Node node(quiet_node());
  auto binding = Binding::bind(node, server->url("lock"), echo::kInterface);
  ASSERT_TRUE(binding) << binding.error().text();
  const rtpm::test::CountLockBreachesOnly count_only;
  const auto before = rtpm::test::lock_breach_count();
  EXPECT_TRUE(binding->call(echo::kEcho, {}));
  EXPECT_EQ(rtpm::test::lock_breach_count() - before, 1u);
  server->stop();
}

TEST(NoAllocationDeathTest, EndsTheProgramOfAServantThatAllocates) {
  if (!rtpm::test::is_alloc_guard_active()) GTEST_SKIP() << rtpm::test::kAllocGuardInactive;
  EXPECT_EXIT(
      {
        EchoServer server;
        Node node(quiet_node());
        Binding binding = bind_echo(node, server);
        static_cast<void>(binding.call(echo::kAllocate, {}));
      },
      testing::KilledBySignal(SIGABRT), "was called by a thread that allocates nothing any more");
}

/// Resolves to one server, and later to none.
class OneName final : public Resolver {
 public:
  explicit OneName(std::string url) : url_(std::move(url)) {}
  expected<std::string, SetupError> resolve(std::string_view, MonotonicTime) override {
    ++resolve_count;
    if (is_bound) return url_;
    return setup_error("it is not bound");
  }
  std::atomic<bool> is_bound{true};
  std::atomic<int> resolve_count{0};

 private:
  std::string url_;
};

// The first calls of an outage make another thread look up the name.
TEST_P(NoAllocation, InCallsByNameAndInTheirOutage) {
  std::optional<EchoServer> server(std::in_place, server_config());
  OneName name(server->url());
  Node node(node_config());
  node.use(name);
  auto binding =
      Binding::bind(node, "lab/echo", echo::kInterface, {.deadline = rtpm::test::kPatience});
  ASSERT_TRUE(binding) << binding.error().text();
  EXPECT_EQ(call_many(*binding, {}), 0);
  server.reset();
  name.is_bound = false;
  {
    const rt::NoAllocationScope no_allocation;
    for (int i = 0; i < 3; ++i)
      EXPECT_FALSE(binding->call(echo::kEcho, {}));
  }
  EXPECT_TRUE(await([&] { return name.resolve_count >= 2; })) << "one was the bind's";
}

// Handshakes, sealed calls in one frame and in many, rejected strangers and forged frames, and the
// end of a session whose grant is revoked: lanes allocate for none of them.
class NoAllocationOfLanes : public testing::TestWithParam<Transport> {};
INSTANTIATE_TEST_SUITE_P(Sealed, NoAllocationOfLanes,
                         testing::Values(Transport::kUdp, Transport::kTcp));

TEST_P(NoAllocationOfLanes, InSealedSessions) {
  if (!rtpm::test::is_alloc_guard_active()) GTEST_SKIP() << rtpm::test::kAllocGuardInactive;
  const KeyFolder folder;
  const crypto::KeyPair key = crypto::KeyPair::generate();
  access::Subject subject;
  subject.kind = access::Subject::Kind::kKey;
  subject.key = key.public_key;
  ServerConfig config = quiet_config();
  config.host = "127.0.0.1";
  config.security.authorized_file =
      folder.write("authorized", access::to_text(subject) + " role=command on=**\n");
  config.security.key_file = folder.file("key");
  config.security.key_log_file = folder.file("keys");
  EchoServer server(config);
  const auto peer_with = [&](const crypto::KeyPair& own) {
    return rtpm::test::SealedPeer(GetParam(), server.server->port(), *server.server->public_key(),
                                  own);
  };
  auto client = peer_with(key);
  ASSERT_TRUE(client.open());
  for (int i = 0; i < 100; ++i)
    ASSERT_TRUE(client.call(echo::kEcho.id, bytes_of("a")).is_ok());
  ASSERT_TRUE(client.call(echo::kEcho.id, Bytes(200'000)).is_ok());
  auto stranger = peer_with(crypto::KeyPair::generate());
  EXPECT_FALSE(stranger.open(std::chrono::milliseconds{50}));
  RawPeer plain(GetParam(), server.server->port());
  EXPECT_FALSE(plain.open(std::chrono::milliseconds{50}));
  folder.write("authorized", "anonymous role=observe on=nothing\n");
  EXPECT_EQ(client.await().kind, rtpm::test::SealedPeer::Kind::kClosed);
}

}  // namespace
}  // namespace rtpm::rpc
