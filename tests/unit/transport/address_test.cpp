#include "rtpm/transport/address.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "frames.hpp"
#include "os/native_socket.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/transport/stream.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport {
namespace {

using namespace test;
using namespace std::chrono_literals;

SocketAddress numeric(const std::string& host, std::uint16_t port = 0) {
  const auto address = SocketAddress::parse(host, port);
  EXPECT_TRUE(address) << host;
  return address.value_or(SocketAddress());
}

/// The system's name of the loopback interface: "lo".
std::string loopback_name() {
  for (const InterfaceAddress& each : own_addresses()) {
    if (each.address.is_loopback()) return each.interface;
  }
  return {};
}

bool has_ipv6() {
  return TcpListener::open("::1", 0).has_value();
}

TEST(SocketAddress, PrintsAsItIsParsed) {
  for (const char* host : {"127.0.0.1", "10.0.0.7", "::1", "2001:db8::7"})
    EXPECT_EQ(numeric(host).host(), host);
  const SocketAddress local = numeric("fe80::1%" + loopback_name());
  EXPECT_NE(local.zone(), 0u);
  EXPECT_EQ(numeric(local.host()), local);
  EXPECT_EQ(numeric("10.0.0.7", 4711).text(), "10.0.0.7:4711");
  EXPECT_EQ(numeric("::1", 4711).text(), "[::1]:4711");
  for (const char* bad : {"", "localhost", "10.0.0", "::g", "fe80::1%no-such-interface", "[::1]"})
    EXPECT_FALSE(SocketAddress::parse(bad, 1)) << bad;
}

TEST(SocketAddress, ConvertsToAPeerAndBack) {
  for (const std::string& host :
       {std::string("127.0.0.1"), std::string("1.0.0.0"), std::string("::1"),
        std::string("2001:db8:1:2:3:4:5:6"), "fe80::1%" + loopback_name()}) {
    const SocketAddress address = numeric(host, 4711);
    EXPECT_EQ(SocketAddress::of(address.peer()), address) << host;
  }
  EXPECT_EQ(numeric("::ffff:10.0.0.7", 1).peer(), numeric("10.0.0.7", 1).peer());
  EXPECT_EQ(numeric("10.0.0.7", 1).mapped_into_ipv6().host(), "::ffff:10.0.0.7");
}

// hp-4-7: quotas apply per IPv4 host, and per /64 of IPv6 addresses.
TEST(SocketAddress, CountsOneIpv6NetworkAsOneHost) {
  const auto are_same = [](const char* a, const char* b) {
    return wire::is_same_host(numeric(a, 1).peer(), numeric(b, 2).peer());
  };
  EXPECT_TRUE(are_same("2001:db8:1:2::1", "2001:db8:1:2:ffff::1"));
  EXPECT_FALSE(are_same("2001:db8:1:2::1", "2001:db8:1:3::1"));
  EXPECT_TRUE(are_same("10.0.0.7", "10.0.0.7"));
  EXPECT_FALSE(are_same("10.0.0.7", "10.0.0.8"));
  EXPECT_FALSE(are_same("::1", "127.0.0.1"));
}

TEST(SocketAddress, IsInTheNetworkOfItsPrefix) {
  const auto is_in = [](const char* own, int bits, const char* address) {
    return is_in_network_of({"eth0", numeric(own), bits}, numeric(address));
  };
  EXPECT_TRUE(is_in("10.0.0.7", 24, "10.0.0.255"));
  EXPECT_FALSE(is_in("10.0.0.7", 24, "10.0.1.7"));
  EXPECT_TRUE(is_in("10.0.0.7", 23, "10.0.1.7"));
  EXPECT_FALSE(is_in("10.0.0.7", 32, "10.0.0.8"));
  EXPECT_TRUE(is_in("fd00::1", 64, "fd00::ffff:1"));
  EXPECT_FALSE(is_in("fd00::1", 64, "fd00:0:0:1::1"));
  EXPECT_FALSE(is_in("fd00::1", 64, "10.0.0.7"));
  EXPECT_FALSE(is_in("10.0.0.7", 0, "10.0.0.7")) << "what has no network shares none";
}

TEST(Host, ResolvesToItsAddresses) {
  const auto addresses = addresses_of("localhost", 4711, rt::now() + 20s);
  ASSERT_TRUE(addresses) << addresses.error().text();
  EXPECT_NE(std::ranges::find(*addresses, numeric("127.0.0.1", 4711)), addresses->end());
  EXPECT_EQ(addresses_of("192.0.2.1", 1, rt::now())->front(), numeric("192.0.2.1", 1));
  EXPECT_EQ(addresses_of("2001:db8::1", 1, rt::now())->front(), numeric("2001:db8::1", 1));
  EXPECT_FALSE(addresses_of("999.1.1.1", 1, rt::now() + 20s));
}

TEST(Host, IsNamedWithTheRemedyIfItHasNoAddress) {
  const MonotonicTime soon = rt::now() + 20s;
  struct Case {
    const char* host;
    MonotonicTime deadline;
    std::vector<std::string> parts;
  };
  for (const Case& each : std::vector<Case>{
           {"", soon, {"host ''", "Remedy"}},
           {"no-such-host.invalid",
            soon,
            {"host 'no-such-host.invalid'", "Remedy: check the name, or give a numeric address"}},
           // Holds whatever the name server does meanwhile.
           {"no-such-host.invalid", rt::now() - 1s, {"host 'no-such-host.invalid'"}},
           {"fe80::1", soon, {"fe80::1", "zone", "Remedy", "fe80::1%eth0"}}}) {
    const auto addresses = addresses_of(each.host, 1, each.deadline);
    ASSERT_FALSE(addresses) << each.host;
    expect_text(addresses.error().text(), each.parts);
  }
}

std::vector<std::string> served(const std::string& hosts) {
  const auto found = hosts_to_serve(hosts, rt::now() + 20s);
  EXPECT_TRUE(found) << found.error().text();
  std::vector<std::string> list;
  for (const InterfaceAddress& each : found->addresses)
    list.push_back(each.interface + " " + each.address.host());
  return list;
}

TEST(HostsToServe, MayBeAddressesNamesAndInterfaces) {
  const std::string name = loopback_name();
  std::vector<std::string> loopback{name + " 127.0.0.1"};
  if (has_ipv6()) loopback.push_back(name + " ::1");
  EXPECT_EQ(served("localhost"), loopback);
  auto of_interface = served(name);
  std::ranges::sort(of_interface);  // The system has an order of its own.
  EXPECT_EQ(of_interface, loopback);
  EXPECT_EQ(served("127.0.0.1,127.0.0.1"), std::vector<std::string>{name + " 127.0.0.1"});
  EXPECT_EQ(served("127.0.0.2," + name).front(), " 127.0.0.2") << "in their order";
  const auto any = hosts_to_serve(name + ",any", rt::now() + 20s);
  EXPECT_TRUE(any && any->is_any && any->addresses.size() >= loopback.size());
}

TEST(HostsToServe, ReportWhichHostIsInvalid) {
  const auto error_of = [](const std::string& hosts) {
    const auto found = hosts_to_serve(hosts, rt::now() + 20s);
    return found ? "" : found.error().text();
  };
  for (const char* wildcard : {"0.0.0.0", "::", "127.0.0.1,0.0.0.0"})
    expect_text(error_of(wildcard), {"no address that callers could use", "Remedy: write any"});
  expect_text(error_of("127.0.0.1,"), {"host ''", "Remedy"});
  std::string many = "127.0.0.1";
  for (int i = 2; i < 19; ++i)
    many += ",127.0.0." + std::to_string(i);
  expect_text(error_of(many), {"18 addresses", "at most 16"});
}

/// A client at `host` sends a datagram, and gets answers, one alone and two in a batch.
void expect_answer_from_where_it_called(UdpPort& port, const std::string& host,
                                        std::uint16_t number) {
  auto client = open_udp_transport(host, number, 0);
  ASSERT_TRUE(client) << client.error().text();
  Bytes buffer(Datagrams::kSizeMax);
  ASSERT_TRUE((*client)->send(frame_of(48)));
  ASSERT_TRUE(rtpm::test::await([&] { return port.await(buffer); }));
  const auto datagrams = port.receive(buffer);
  ASSERT_TRUE(datagrams);
  EXPECT_EQ(port.host_of(datagrams->peer()), this_host()) << host;
  ASSERT_TRUE(port.send(datagrams->peer(), frame_of(1)));
  DatagramBatch batch = DatagramBatch::allocate();
  ASSERT_TRUE(batch.add(frame_of(2)) && batch.add(frame_of(2)));
  ASSERT_TRUE(port.send_batch(datagrams->peer(), batch));
  // The client is connected: the system passes it no datagram from another address.
  for (int i = 0; i < 3; ++i)
    ASSERT_TRUE(rtpm::test::await([&] { return (*client)->receive().has_value(); })) << host << i;
}

// hp-10-3
TEST(UdpPort, AnswersFromTheCalledAddress) {
  const std::uint16_t number = TcpListener::open("127.0.0.1", 0)->port();
  auto port = UdpPort::open({.host = "any", .port = number});
  ASSERT_TRUE(port) << port.error().text();
  for (const char* host : {"127.0.0.1", "127.0.0.2", "127.0.0.3", "127.0.0.2"})
    expect_answer_from_where_it_called(*port, host, number);
  if (has_ipv6()) expect_answer_from_where_it_called(*port, "::1", number);
}

/// The peer of a datagram from `source`, one of this host's addresses.
wire::PeerAddress peer_of_datagram(UdpPort& port, const char* source, std::uint16_t number) {
  const Descriptor client = os::open_socket(AF_INET, SOCK_DGRAM, os::Blocking::kYes);
  const SocketAddress own = numeric(source);
  const SocketAddress server = numeric("127.0.0.1", number);
  EXPECT_EQ(bind(client.number(), native(own), size_of(own)), 0) << source;
  EXPECT_EQ(sendto(client.number(), "x", 1, 0, native(server), size_of(server)), 1) << source;
  Bytes buffer(Datagrams::kSizeMax);
  EXPECT_TRUE(rtpm::test::await([&] { return port.await(buffer); }));
  const auto datagrams = port.receive(buffer);
  EXPECT_EQ(SocketAddress::of(datagrams->peer()).host(), source) << "where the answer goes";
  EXPECT_EQ(port.host_of(datagrams->peer()), this_host()) << source;
  return datagrams->peer();
}

// hp-4-7: any program may call from any address of 127.0.0.0/8.
TEST(UdpPort, CountsAllCallersOfThisHostAsOneHost) {
  for (const char* host : {"127.0.0.1", "any"}) {
    const std::uint16_t number = TcpListener::open("127.0.0.1", 0)->port();
    auto port = UdpPort::open({.host = host, .port = number});
    ASSERT_TRUE(port) << port.error().text();
    const wire::PeerAddress first = peer_of_datagram(*port, "127.0.0.1", number);
    for (const char* source : {"127.0.0.2", "127.255.1.7"}) {
      const wire::PeerAddress next = peer_of_datagram(*port, source, number);
      EXPECT_TRUE(wire::is_same_host(first, next)) << source;
      EXPECT_FALSE(next == first) << "another peer of it";
    }
    EXPECT_FALSE(wire::is_same_host(first, numeric("10.0.0.7", 1).peer()));
  }
}

TEST(UdpPort, IsReachedAtItsAddressOnly) {
  const std::uint16_t number = TcpListener::open("127.0.0.1", 0)->port();
  auto port = UdpPort::open({.host = "127.0.0.2", .port = number, .index = 3});
  ASSERT_TRUE(port) << port.error().text();
  expect_answer_from_where_it_called(*port, "127.0.0.2", number);
  auto client = open_udp_transport("127.0.0.1", number, 0);
  ASSERT_TRUE(client);
  static_cast<void>((*client)->send(frame_of(48)));
  ASSERT_TRUE(rtpm::test::await([&] {
    const auto received = (*client)->receive();
    return !received && received.error() == IoError::kRefused;
  }));
}

TEST(TcpListener, AcceptsBothFamiliesAtAnyAddress) {
  auto listener = TcpListener::open("any", 0);
  ASSERT_TRUE(listener) << listener.error().text();
  std::optional<wire::PeerAddress> first;
  for (const char* host : {"127.0.0.1", "127.0.0.2", "::1"}) {
    if (std::string(host) == "::1" && !has_ipv6()) continue;
    const auto client = open_tcp_transport(host, listener->port(), 0, 1000, rt::now() + 20s);
    ASSERT_TRUE(client) << client.error().text();
    ASSERT_TRUE(wait_readable(listener->descriptor(), rt::now() + 20s));
    const Accepted accepted = listener->accept();
    EXPECT_TRUE(is_from_this_host(accepted.socket.number())) << host;
    // hp-4-7
    const wire::PeerAddress caller = host_of(accepted.socket.number());
    EXPECT_TRUE(wire::is_same_host(first.value_or(caller), caller)) << host;
    first = first.value_or(caller);
  }
}

}  // namespace
}  // namespace rtpm::transport
