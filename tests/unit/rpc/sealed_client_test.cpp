#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <map>
#include <mutex>
#include <thread>

#include "client/node_impl.hpp"
#include "rtpm/access/files.hpp"
#include "rtpm/access/fingerprint.hpp"
#include "rtpm/access/known_servers.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/serve.hpp"
#include "rtpm/wire/control.hpp"
#include "secured_server.hpp"

// RTPM's client over sealed sessions, with a real server.
namespace rtpm::rpc {
namespace {

using namespace test;
using namespace std::chrono_literals;

/// Counts how often each number was called.
class NumberServant final : public Servant {
 public:
  const InterfaceDescriptor& interface() const noexcept override { return echo::kInterface; }
  DispatchResult dispatch(std::uint16_t, ConstBytes request, MutableBytes,
                          const CallContext&) override {
    const rt::AllowAllocationScope is_allowed;
    const std::lock_guard lock(mutex_);
    ++counts_[load_le<std::uint64_t>(request.data())];
    return {};
  }
  [[nodiscard]] std::size_t repeated_count() {
    const std::lock_guard lock(mutex_);
    return static_cast<std::size_t>(
        std::ranges::count_if(counts_, [](const auto& row) { return row.second > 1; }));
  }
  [[nodiscard]] std::size_t count() {
    const std::lock_guard lock(mutex_);
    return counts_.size();
  }

 private:
  rt::PiMutex mutex_;
  std::map<std::uint64_t, int> counts_;
};

class SealedClientTest : public testing::TestWithParam<Transport> {
 protected:
  SealedClientTest() {
    key_ = access::make_key(folder_.file("client"), "client")->public_key;
    server_key_ = access::make_key(folder_.file("server"), "server")->public_key;
  }
  [[nodiscard]] ServerConfig server_config() const {
    ServerConfig config = quiet_config();
    config.host = "127.0.0.1";
    config.security.authorized_file = folder_.write(
        "authorized", access::public_key_text(key_) + " name=client role=command on=**\n");
    config.security.key_file = folder_.file("server");
    return config;
  }
  void know(const std::string& lines) const { folder_.write("known_servers", lines); }
  void know_server() const { know("127.0.0.1 " + access::public_key_text(server_key_) + "\n"); }
  [[nodiscard]] NodeConfig node_config() const {
    NodeConfig config = quiet_node(GetParam());
    config.security.key_file = folder_.file("client");
    config.security.known_servers_file = folder_.file("known_servers");
    return config;
  }
  [[nodiscard]] static SetupError error_of_bind(Node& node, const std::string& url,
                                                Duration patience = 400ms) {
    BindOptions options;
    options.deadline = patience;
    auto bound = Binding::bind(node, url, echo::kInterface, options);
    EXPECT_FALSE(bound);
    return bound ? SetupError{} : bound.error();
  }
  static expected<ReplyLease, CallError> call_number(Binding& binding, std::uint64_t number,
                                                     Duration deadline = rtpm::test::kPatience) {
    std::array<std::byte, 8> request{};
    store_le(request.data(), number);
    CallOptions options;
    options.deadline = deadline;
    return binding.call(echo::kEchoOnce, request, options);
  }

  KeyFolder folder_;
  crypto::PublicKey key_{};
  crypto::PublicKey server_key_{};
};

INSTANTIATE_TEST_SUITE_P(Both, SealedClientTest, testing::Values(Transport::kUdp, Transport::kTcp),
                         [](const auto& row) {
                           return row.param == Transport::kUdp ? "Udp" : "Tcp";
                         });

TEST_P(SealedClientTest, ReportsHowToLearnTheKeyOfAnUnknownServer) {
  EchoServer server(server_config());
  Node node(node_config());
  const SetupError error = error_of_bind(node, server.url());
  EXPECT_EQ(error.cause, CallError::kNotAllowed);
  expect_text(error.text(), {"rtpm key learn 127.0.0.1:" + std::to_string(server.server->port())});
}

TEST_P(SealedClientTest, CallsAnUnknownOpenServerUnsealed) {
  EchoServer server;
  know("10.9.8.7 " + access::public_key_text(server_key_) + "\n");
  NodeConfig config = node_config();
  config.security.key_file = folder_.file("none");
  Node node(config);
  Binding binding = bind_echo(node, server);
  EXPECT_TRUE(binding.call(echo::kEcho, bytes_of("a")));
}

TEST_P(SealedClientTest, RefusesAnUnsealedServerInPlaceOfAKnownOne) {
  ServerConfig config = quiet_config();
  config.host = "127.0.0.1";
  EchoServer server(config);
  know_server();
  Node node(node_config());
  const SetupError error = error_of_bind(node, server.url());
  expect_text(error.text(), {"no sealed session", "line 1 of known_servers"});
  EXPECT_EQ(server.servant.run_count(), 0);
}

TEST_P(SealedClientTest, ReportsAnotherKeyWithItsLine) {
  EchoServer server(server_config());
  know("# cell\n127.0.0.1 " + access::public_key_text(key_) + "\n");
  Node node(node_config());
  const SetupError error = error_of_bind(node, server.url());
  expect_text(error.text(), {"line 2 of known_servers"});
  if (GetParam() != Transport::kUdp) return;  // Over TCP the server shows no key.
  expect_text(error.text(), {"another key", "in between", access::fingerprint(server_key_),
                             "rtpm key forget 127.0.0.1, then rtpm key learn 127.0.0.1:"});
}

TEST_P(SealedClientTest, TriesEachOfTwoKeys) {
  EchoServer server(server_config());
  know("127.0.0.1 " + access::public_key_text(key_) + "\n127.0.0.1 " +
       access::public_key_text(server_key_) + "\n");
  Node node(node_config());
  BindOptions options;
  options.deadline = 1s;
  EXPECT_TRUE(Binding::bind(node, server.url(), echo::kInterface, options));
}

TEST_P(SealedClientTest, ReportsHowToAuthorizeAnUnknownClient) {
  EchoServer server(server_config());
  know_server();
  const auto own = access::make_key(folder_.file("stranger"), "x")->public_key;
  NodeConfig config = node_config();
  config.security.key_file = folder_.file("stranger");
  Node node(config);
  const SetupError error = error_of_bind(node, server.url());
  EXPECT_EQ(error.cause, CallError::kNotAllowed);
  expect_text(error.text(), {"rtpm key authorize '" + access::public_key_text(own) + "'"});
}

TEST_P(SealedClientTest, ReportsHowToMakeAMissingKey) {
  EchoServer server(server_config());
  know_server();
  NodeConfig config = node_config();
  config.security.key_file = folder_.file("none");
  Node node(config);
  expect_text(error_of_bind(node, server.url()).text(), {folder_.file("none"), "rtpm key new"});
  ASSERT_TRUE(access::make_key(folder_.file("none"), "x"));
  folder_.write("authorized",
                access::public_key_text(access::read_key(folder_.file("none"))->public_key) +
                    " role=command on=**\n");
  std::filesystem::permissions(folder_.file("none"), std::filesystem::perms::group_read,
                               std::filesystem::perm_options::add);
  expect_text(error_of_bind(node, server.url()).text(), {folder_.file("none"), "others"});
}

// A file that other users may write could name the attacker's key, or no server at all.
TEST_P(SealedClientTest, RefusesOtherHostsWithAnUntrustedFileOfServers) {
  EchoServer server;
  know_server();
  std::filesystem::permissions(folder_.file("known_servers"), std::filesystem::perms::others_write,
                               std::filesystem::perm_options::add);
  Node node(node_config());
  const SetupError error = error_of_bind(node, "rtpm://192.0.2.1:7420/echo", 100ms);
  expect_text(error.text(), {folder_.file("known_servers"), "others can write it"});
  Binding binding = bind_echo(node, server);
  EXPECT_TRUE(binding.call(echo::kEcho, bytes_of("a")));
}

TEST_P(SealedClientTest, KeepsTheOtherLinesOfAFaultyFileAndReloadsIt) {
  EchoServer server(server_config());
  know("nonsense\n");
  Node node(node_config());
  EXPECT_EQ(error_of_bind(node, server.url()).cause, CallError::kNotAllowed);
  know("nonsense\n127.0.0.1:" + std::to_string(server.server->port()) + " " +
       access::public_key_text(server_key_) + "\n");
  Binding binding = bind_echo(node, server);
  EXPECT_TRUE(binding.call(echo::kEcho, bytes_of("a")));
}

// Each session seals 200 frames at most; then the client needs another one.
TEST_P(SealedClientTest, RenewsKeysWithoutAFailedCall) {
  EchoServer server(server_config());
  know_server();
  Node node(node_config());
  node.impl().keys.limits = {.generation_bits = 10, .counter_end = 200, .forged_max = 1000};
  Binding binding = bind_echo(node, server);
  for (std::uint64_t number = 0; number < 1000; ++number) {
    const auto reply = call_number(binding, number);
    ASSERT_TRUE(reply) << number << ": " << to_string(reply.error());
  }
  EXPECT_EQ(server.servant.run_count(), 1000);
  EXPECT_GE(server.server->counters().frames.session_opened_count, 6u);
}

// There is no time for new keys: the call may have run, and the next one gets a new session.
TEST_P(SealedClientTest, FailsACallWhoseSessionEnds) {
  EchoServer server(server_config());
  know_server();
  Node node(node_config());
  node.impl().keys.limits = {.generation_bits = 10, .counter_end = 40, .forged_max = 1000};
  Binding binding = bind_echo(node, server);
  const Bytes large(GetParam() == Transport::kUdp ? 100'000 : 4'000'000);
  const auto reply = binding.call(echo::kEchoOnce, large);
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error(), CallError::kDisconnected);
  EXPECT_TRUE(call_number(binding, 1));
}

// sec-3.2-3: the lane is busy, so that a second channel's handshake lasts longer than its call.
TEST_P(SealedClientTest, CallsAgainAfterAHandshakeThatWasGivenUp) {
  EchoServer server(server_config());
  know_server();
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  auto holding = binding.begin(echo::kHold, {});
  ASSERT_TRUE(holding);
  ASSERT_TRUE(await([&] { return server.servant.gate().inside_count() == 1; }));
  const auto late = call_number(binding, 1, 50ms);
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error(), CallError::kTimeout);
  server.servant.gate().open();
  const auto next = call_number(binding, 2);
  EXPECT_TRUE(next) << to_string(next.error());
}

TEST_P(SealedClientTest, RenewsKeysByAge) {
  EchoServer server(server_config());
  know_server();
  Node node(node_config());
  node.impl().keys.renewal_interval = 30ms;
  Binding binding = bind_echo(node, server);
  int count = 0;
  EXPECT_TRUE(await([&] {
    EXPECT_TRUE(call_number(binding, 1));
    ++count;
    return server.server->counters().frames.session_opened_count >= 3;
  }));
  EXPECT_EQ(server.servant.run_count(), count);
}

TEST_P(SealedClientTest, RunsNothingTwiceOverServerRestarts) {
  NumberServant servant;
  ServerConfig config = server_config();
  auto server = rtpm::test::serve("echo", servant, config);
  config.port = server->port();
  know_server();
  Node node(node_config());
  auto bound = Binding::bind(node, server->url("echo"), echo::kInterface);
  ASSERT_TRUE(bound) << bound.error().text();
  std::atomic<bool> is_over{false};
  std::atomic<std::uint64_t> good_count{0};
  std::thread caller([&] {
    for (std::uint64_t number = 0; !is_over; ++number) {
      if (call_number(*bound, number, 2s)) {
        ++good_count;
      } else {
        std::this_thread::sleep_for(1ms);
      }
    }
  });
  for (int round = 0; round < 3; ++round) {
    ASSERT_TRUE(await([&, seen = good_count + 20] { return good_count > seen; }));
    server->stop();
    server.reset();
    server = rtpm::test::serve("echo", servant, config);
    ASSERT_TRUE(await([&, seen = good_count + 0] { return good_count > seen; }));
  }
  is_over = true;
  caller.join();
  server->stop();
  EXPECT_EQ(servant.repeated_count(), 0u);
  EXPECT_GE(servant.count(), good_count);
}

TEST_P(SealedClientTest, WritesTheSameKeyLogOnBothSides) {
  ServerConfig config = server_config();
  config.security.key_log_file = folder_.file("server-log");
  EchoServer server(config);
  know_server();
  NodeConfig with_log = node_config();
  with_log.security.key_log_file = folder_.file("client-log");
  Node node(with_log);
  Binding binding = bind_echo(node, server);
  EXPECT_TRUE(binding.call(echo::kEcho, bytes_of("a")));
  const std::string log = folder_.read("client-log");
  EXPECT_TRUE(log.starts_with("RTPM_SESSION ")) << log;
  EXPECT_EQ(log, folder_.read("server-log"));
  for (const char* name : {"client-log", "server-log"}) {
    EXPECT_EQ(std::filesystem::status(folder_.file(name)).permissions(),
              std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  }
}

// sec-5-2: a child process has none of its parent's keys, and does not disturb its sessions.
TEST_P(SealedClientTest, FailsInAForkedChildOnly) {
  EchoServer server(server_config());
  know_server();
  Node node(node_config());
  Binding binding = bind_echo(node, server);
  ASSERT_TRUE(binding.call(echo::kEcho, bytes_of("a")));
  const pid_t child = fork();
  if (child == 0) {
    CallOptions options;
    options.deadline = 300ms;
    const auto reply = binding.call(echo::kEcho, bytes_of("b"), options);
    _exit(reply ? 1 : 0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  for (int i = 0; i < 10; ++i)
    ASSERT_TRUE(binding.call(echo::kEcho, bytes_of("c")));
  EXPECT_EQ(server.server->counters().frames.session_opened_count, 1u);
}

/// The forgeries of an attacker on the path who has seen this datagram of the server.
std::vector<std::vector<char>> forged_about(const std::vector<char>& datagram) {
  const auto seen = wire::decode(std::as_bytes(std::span(datagram)));
  if (!seen) return {};
  std::vector<std::vector<char>> forged;
  const auto add = [&](wire::FrameKind kind, wire::Status status, std::uint32_t size) {
    wire::Header header;
    header.kind = kind;
    header.priority = seen->priority;
    header.session = seen->session;
    header.call_id = seen->call_id;
    header.status = status;
    header.payload_size = header.message_size = size;
    std::vector<char> frame(wire::kHeaderSize + size);
    wire::encode(header, reinterpret_cast<std::byte*>(frame.data()));
    forged.push_back(std::move(frame));
  };
  add(wire::FrameKind::kRefuse, wire::Status::kUnknownSession, 0);
  add(wire::FrameKind::kRefuse, wire::Status::kNotAllowed, 0);
  add(wire::FrameKind::kClose, wire::Status::kOk, 0);
  add(wire::FrameKind::kCookie, wire::Status::kOk, sizeof(wire::Cookie));
  add(wire::FrameKind::kWelcome, wire::Status::kOk, wire::Welcome::kSize);
  add(wire::FrameKind::kReply, wire::Status::kServantFailed, 0);
  return forged;
}

TEST(SealedClient, IgnoresForgedHints) {
  const SealedFiles files;
  ServerConfig config = quiet_config();
  config.host = "127.0.0.1";
  config.security = files.of_server();
  NumberServant servant;
  const auto server = rtpm::test::serve("echo", servant, config);
  rtpm::test::FaultyRelay relay(
      server->port(), {.loss = 0, .repetition = 0.2, .delay = 0.05, .forge = &forged_about});
  NodeConfig node_config = quiet_node();
  node_config.security = files.of_node();
  Node node(node_config);
  auto bound = Binding::bind(node, "rtpm://127.0.0.1:" + std::to_string(relay.port()) + "/echo",
                             echo::kInterface);
  ASSERT_TRUE(bound) << bound.error().text();
  constexpr std::uint64_t kCallCount = 300;
  for (std::uint64_t number = 0; number < kCallCount; ++number) {
    std::array<std::byte, 8> request{};
    store_le(request.data(), number);
    const auto reply = bound->call(echo::kEchoOnce, request);
    ASSERT_TRUE(reply) << number << ": " << to_string(reply.error());
  }
  EXPECT_EQ(servant.count(), kCallCount);
  EXPECT_EQ(servant.repeated_count(), 0u);
  EXPECT_EQ(server->counters().frames.session_opened_count, 1u);
  server->stop();
}

}  // namespace
}  // namespace rtpm::rpc
