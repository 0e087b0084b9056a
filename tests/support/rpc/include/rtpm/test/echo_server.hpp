#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/test/echo.hpp"
#include "rtpm/test/faulty_relay.hpp"
#include "rtpm/test/raw_peer.hpp"
#include "rtpm/test/sealed_files.hpp"
#include "rtpm/test/text.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/transport/tcp.hpp"

/// A server with the echo servant, and nodes and bindings for it.
namespace rtpm::rpc {

inline void PrintTo(CallError error, std::ostream* out) {
  *out << to_string(error);
}

namespace test {

namespace echo = rtpm::test::echo;
using rtpm::test::await;
using rtpm::test::Bytes;
using rtpm::test::RawPeer;

/// Whether a call ended because its time was over. Either side may notice that first.
[[nodiscard]] constexpr bool is_late(CallError error) noexcept {
  return error == CallError::kTimeout || error == CallError::kExpired;
}

/// Suites run for each kind of lane: with a single thread, or with a pool, for which the
/// environment's RTPM_TEST_BUFFERED_REQUESTS sets the size of the request buffer.
[[nodiscard]] inline std::uint32_t buffered_requests() {
  const char* const text = std::getenv("RTPM_TEST_BUFFERED_REQUESTS");
  return text == nullptr ? 0 : static_cast<std::uint32_t>(std::atoi(text));
}

/// Not one of RTPM's transports: UDP over a network that loses, repeats, delays and reorders.
inline constexpr Transport kFaultyUdp{100};

/// UDP and TCP with sealed sessions; not RTPM's transports either.
inline constexpr Transport kSealedUdp{101};
inline constexpr Transport kSealedTcp{102};
[[nodiscard]] constexpr bool is_sealed(Transport transport) noexcept {
  return transport == kSealedUdp || transport == kSealedTcp;
}

/// Whether the servers of the running test require grants that their callers have.
[[nodiscard]] inline bool& are_sessions_sealed() noexcept {
  static bool is_sealed = false;
  return is_sealed;
}
/// The files of both sides, in a folder that is removed with the program.
[[nodiscard]] inline const SealedFiles& sealed_files() {
  static const SealedFiles files;
  return files;
}

/// Whether the servers of the running test are behind a faulty network.
[[nodiscard]] inline bool& is_network_faulty() noexcept {
  static bool is_faulty = false;
  return is_faulty;
}
/// Suites that run for both kinds of lane also run for both address families: for pools over IPv6,
/// where this host has it, which callers try first. The relay that makes a network faulty knows
/// IPv4 only.
[[nodiscard]] inline std::string test_hosts() {
  static const bool has_ipv6 = transport::TcpListener::open("::1", 0).has_value();
  const bool is_by_ipv6 = buffered_requests() > 0 && has_ipv6 && !is_network_faulty();
  return is_by_ipv6 ? "::1,127.0.0.1" : "127.0.0.1";
}

/// Lanes that block at once and are not real-time, for tests that are not about time.
[[nodiscard]] inline LaneConfig quiet_lane(Priority low = 0) {
  return {.low = low,
          .wait = {.strategy = rt::WaitStrategy::kBlock},
          .buffered_request_max = buffered_requests()};
}
[[nodiscard]] inline ServerConfig quiet_config(std::vector<LaneConfig> lanes = {quiet_lane()}) {
  ServerConfig config;
  config.name = "test";
  config.host = test_hosts();
  config.lanes = std::move(lanes);
  config.realtime = rt::RealtimeMode::kOff;
  if (are_sessions_sealed()) config.security = sealed_files().of_server();
  return config;
}

/// The relay's faults, by the seed RTPM_SEED if the environment has one.
[[nodiscard]] inline rtpm::test::FaultyRelay::Faults faults() {
  rtpm::test::FaultyRelay::Faults faults;
  if (const char* const seed = std::getenv("RTPM_SEED")) faults.seed = std::stoull(seed);
  return faults;
}

/// A started server of `config` with the servant under "echo".
struct EchoServer {
  explicit EchoServer(ServerConfig config = quiet_config(), ObjectOptions options = {}) {
    auto created = Server::create(std::move(config));
    EXPECT_TRUE(created) << created.error().text();
    if (!created) return;
    server = std::move(*created);
    const auto added = server->add("echo", servant, std::move(options));
    EXPECT_TRUE(added) << added.error().text();
    const auto started = server->start();
    EXPECT_TRUE(started) << started.error().text();
  }
  ~EchoServer() {
    servant.gate().open();
    if (server) server->stop();
  }
  EchoServer(const EchoServer&) = delete;
  EchoServer& operator=(const EchoServer&) = delete;
  /// The address at which callers of this test find the servant.
  [[nodiscard]] std::string url() const {
    const std::string straight = server->url("echo");
    if (!is_network_faulty()) return straight;
    if (!relay) relay = std::make_unique<rtpm::test::FaultyRelay>(server->port(), faults());
    return "rtpm://127.0.0.1:" + std::to_string(relay->port()) + "/echo";
  }

  echo::Servant servant;
  std::unique_ptr<Server> server;
  mutable std::unique_ptr<rtpm::test::FaultyRelay> relay;
};

/// The transports between programs of this host that the system offers.
[[nodiscard]] inline std::vector<Transport> transports_of_host() {
  if (!transport::offers_shared_memory()) return {Transport::kUdp, Transport::kTcp};
  return {Transport::kUdp, Transport::kTcp, Transport::kSharedMemory};
}

[[nodiscard]] inline NodeConfig quiet_node(Transport transport = Transport::kUdp) {
  NodeConfig config;
  // kAuto gives this transport where the server is in the same program.
  config.transport = transport == Transport::kLocal ? Transport::kAuto : transport;
  if (transport == kFaultyUdp || transport == kSealedUdp) config.transport = Transport::kUdp;
  if (transport == kSealedTcp) config.transport = Transport::kTcp;
  if (is_sealed(transport)) config.security = sealed_files().of_node();
  config.wait.strategy = rt::WaitStrategy::kBlock;
  config.default_deadline = rtpm::test::kPatience;
  return config;
}

/// A binding to the server's echo; fails the test if there is none.
[[nodiscard]] inline Binding bind_echo(Node& node, const EchoServer& server,
                                       BindOptions options = {}) {
  if (options.deadline == BindOptions{}.deadline) options.deadline = rtpm::test::kPatience;
  auto bound = Binding::bind(node, server.url(), echo::kInterface, options);
  EXPECT_TRUE(bound) << bound.error().text();
  return std::move(*bound);
}

[[nodiscard]] inline ConstBytes bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text));
}
[[nodiscard]] inline std::string text_of(const ReplyLease& reply) {
  return {reinterpret_cast<const char*>(reply.bytes().data()), reply.bytes().size()};
}

/// The servant's report of where it ran; fails the test if the call failed.
[[nodiscard]] inline echo::Place place_of(Binding& binding, const CallOptions& options = {}) {
  const auto reply = binding.call(echo::kWhere, {}, options);
  EXPECT_TRUE(reply) << to_string(reply.error());
  echo::Place place{};
  if (!reply) return place;
  EXPECT_EQ(reply->bytes().size(), sizeof place);
  std::memcpy(&place, reply->bytes().data(), sizeof place);
  return place;
}

using rtpm::test::expect_text;

}  // namespace test
}  // namespace rtpm::rpc
