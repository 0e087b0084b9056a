#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

#include <cstdlib>
#include <string>
#include <vector>

#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/other_hosts.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"
#include "rtpm/wire/url.hpp"

// Servers at addresses other than a single IPv4 one, and clients with several to choose from.
namespace rtpm::rpc {
namespace {

using namespace test;
using namespace std::chrono_literals;

bool has_ipv6() {
  return transport::TcpListener::open("::1", 0).has_value();
}

ServerConfig config_at(const std::string& host) {
  ServerConfig config = quiet_config({quiet_lane(0), quiet_lane(20'000)});
  config.host = host;
  config.security.is_insecure = true;
  return config;
}

std::string url_at(const std::string& hosts, std::uint16_t port) {
  return "rtpm://" + hosts + ":" + std::to_string(port) + "/echo";
}

/// Whether calls of both lanes, small and large, are answered at the host.
void expect_served_at(const std::string& host, std::uint16_t port, Transport transport) {
  Node node(quiet_node(transport));
  auto echo = Binding::bind(node, url_at(host, port), echo::kInterface, {.deadline = 20s});
  ASSERT_TRUE(echo) << echo.error().text();
  EXPECT_EQ(echo->transport(), transport);
  const Bytes large(100'000, std::byte{7});
  for (const Priority priority : {Priority{0}, Priority{30'000}}) {
    const auto reply = echo->call(echo::kEcho, large, {.priority = priority});
    ASSERT_TRUE(reply) << host << ": " << to_string(reply.error());
    EXPECT_TRUE(std::ranges::equal(reply->bytes(), large));
  }
}

TEST(ServerAtAnyAddress, IsReachedAtEachAddress) {
  const EchoServer server(config_at("any"));
  std::vector<std::string> hosts{"127.0.0.1", "127.0.0.2"};
  if (has_ipv6()) hosts.emplace_back("[::1]");
  for (const std::string& host : hosts) {
    for (const Transport transport : {Transport::kUdp, Transport::kTcp})
      expect_served_at(host, server.server->port(), transport);
  }
  expect_served_at("127.0.0.1", server.server->port(), transports_of_host().back());
}

TEST(ServerAtSeveralAddresses, IsReachedAtTheseOnly) {
  const EchoServer server(
      config_at(has_ipv6() ? "127.0.0.2,127.0.0.3,::1" : "127.0.0.2,127.0.0.3"));
  const std::uint16_t port = server.server->port();
  std::vector<std::string> hosts{"127.0.0.2", "127.0.0.3"};
  if (has_ipv6()) hosts.emplace_back("[::1]");
  for (const std::string& host : hosts) {
    for (const Transport transport : transports_of_host())
      expect_served_at(host, port, transport);
  }
  EXPECT_EQ(wire::parse_url(server.url())->hosts.size(), hosts.size());
  EXPECT_TRUE(transport::TcpListener::open("127.0.0.4", port));
  EXPECT_TRUE(transport::UdpPort::open({.host = "127.0.0.4", .port = port}));
}

TEST(ServerSetUp, AdvertisesAddressesThatOthersCanReach) {
  const auto url_of = [](const ServerConfig& config) {
    const auto server = Server::create(config);
    return server ? *wire::parse_url((*server)->url("a")) : wire::Url{};
  };
  for (const std::string& host : url_of(config_at("any")).hosts) {
    const auto address = transport::SocketAddress::parse(host, 0);
    ASSERT_TRUE(address) << host;
    EXPECT_FALSE(address->is_unspecified() || address->is_link_local()) << host;
  }
  EXPECT_EQ(url_of(config_at("127.0.0.1")).hosts, std::vector<std::string>{"127.0.0.1"});
  ServerConfig config = config_at("127.0.0.1");
  config.advertise = "robot.lab,10.0.0.7,fd00::7";
  EXPECT_EQ(url_of(config).hosts, (std::vector<std::string>{"robot.lab", "10.0.0.7", "fd00::7"}));
  config.advertise = "robot lab";
  const auto refused = Server::create(config);
  ASSERT_FALSE(refused);
  expect_text(refused.error().text(), {"'robot lab' is no list of hosts to advertise", "Remedy"});
}

// hp-10-2
TEST(ClientOfSeveralHosts, UsesTheFirstThatAnswers) {
  const EchoServer server(config_at("127.0.0.3"));
  const std::uint16_t port = server.server->port();
  // The second server is silent: it costs its share of the deadline, and no more.
  const auto silent = transport::UdpPort::open({.host = "127.0.0.2", .port = port});
  Node node(quiet_node());
  const auto echo = Binding::bind(node, url_at("127.0.0.4,127.0.0.2,127.0.0.3", port),
                                  echo::kInterface, {.deadline = 6s});
  ASSERT_TRUE(echo) << echo.error().text();
  EXPECT_EQ(echo->url(), url_at("127.0.0.4,127.0.0.2,127.0.0.3", port));
}

TEST(ClientOfSeveralHosts, ReportsWhyEachHostFailed) {
  const std::uint16_t port = transport::TcpListener::open("127.0.0.1", 0)->port();
  const std::string number = std::to_string(port);
  Node node(quiet_node());
  const auto echo = Binding::bind(node, url_at("no-such-host.invalid,127.0.0.1,[::1]", port),
                                  echo::kInterface, {.deadline = 1s});
  ASSERT_FALSE(echo);
  expect_text(echo.error().text(), {"'echo' can't be bound at rtpm://no-such-host.invalid,",
                                    "host 'no-such-host.invalid'", "127.0.0.1:" + number + ": ",
                                    "[::1]:" + number + ": "});
}

TEST(ClientOfSeveralHosts, ReportsARefusal) {
  const EchoServer server(config_at("127.0.0.3"));
  Node node(quiet_node());
  const auto other = Binding::bind(
      node, "rtpm://127.0.0.3,127.0.0.4:" + std::to_string(server.server->port()) + "/other",
      echo::kInterface, {.deadline = 1s});
  ASSERT_FALSE(other);
  expect_text(other.error().text(), {"no object 'other' is served at"});
  EXPECT_EQ(other.error().cause, CallError::kNoSuchObject);
}

// A firewall drops datagrams, but passes connections.
TEST(ClientOverUdp, ReportsThatTheServerAnswersOnlyOverTcp) {
  const rtpm::test::OtherHosts hosts;
  if (!hosts.is_there()) GTEST_SKIP() << rtpm::test::OtherHosts::kMissing;
  if (std::system("command -v nft >/dev/null") != 0) GTEST_SKIP() << "the program 'nft' is missing";
  const EchoServer server(config_at("10.77.0.1"));
  const std::string port = std::to_string(server.server->port());
  ASSERT_EQ(std::system(("nft add table inet t && "
                         "nft 'add chain inet t i { type filter hook input priority 0; }' && "
                         "nft add rule inet t i udp dport " +
                         port + " drop")
                            .c_str()),
            0);
  Node node(quiet_node(Transport::kUdp));
  const auto echo = Binding::bind(node, url_at("10.77.0.1", server.server->port()),
                                  echo::kInterface, {.deadline = 1s});
  ASSERT_FALSE(echo);
  expect_text(echo.error().text(),
              {"answers over TCP, but not over UDP", "UDP port " + port, "firewalls"});
  EXPECT_EQ(echo.error().cause, CallError::kTimeout);
}

// The system accepts connections for a server that hangs.
TEST(ClientOverUdp, DoesNotMentionTcpIfNoServerAnswers) {
  const rtpm::test::OtherHosts hosts;
  if (!hosts.is_there()) GTEST_SKIP() << rtpm::test::OtherHosts::kMissing;
  const auto silent = transport::TcpListener::open("10.77.0.1", 0);
  ASSERT_TRUE(silent);
  const auto silent_udp = transport::UdpPort::open({.host = "10.77.0.1", .port = silent->port()});
  ASSERT_TRUE(silent_udp);
  Node node(quiet_node(Transport::kUdp));
  const auto echo =
      Binding::bind(node, url_at("10.77.0.1", silent->port()), echo::kInterface, {.deadline = 1s});
  ASSERT_FALSE(echo);
  EXPECT_EQ(echo.error().text().find("TCP"), std::string::npos) << echo.error().text();
}

TEST(LoopbackThatIsDown, IsReportedByClientsAndServers) {
  const int former = open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC);
  if (unshare(CLONE_NEWNET) != 0) GTEST_SKIP() << rtpm::test::OtherHosts::kMissing;
  Node node(quiet_node(Transport::kUdp));
  const auto echo =
      Binding::bind(node, "rtpm://127.0.0.1:7420/echo", echo::kInterface, {.deadline = 1s});
  const auto server = Server::create(config_at("127.0.0.1"));
  ASSERT_EQ(setns(former, CLONE_NEWNET), 0);
  close(former);
  ASSERT_FALSE(echo);
  expect_text(echo.error().text(), {"sudo ip link set dev lo up"});
  ASSERT_FALSE(server);
  expect_text(server.error().text(), {"sudo ip link set dev lo up"});
}

TEST(CallerHost, IsPrintedAsAnAddressOrNetwork) {
  EXPECT_EQ(to_string(kThisHost), "127.0.0.1");
  EXPECT_EQ(to_string(CallerHost{0x0a00'0007}), "10.0.0.7");
  EXPECT_EQ(to_string(CallerHost{0x2001'0db8'0001'0002}), "2001:db8:1:2::/64");
  EXPECT_FALSE(CallerHost{0x7f00'0000'0000'0000}.is_this_host());
}

}  // namespace
}  // namespace rtpm::rpc
