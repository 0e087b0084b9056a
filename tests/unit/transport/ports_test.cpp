#include <gtest/gtest.h>
#include <sys/socket.h>

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "frames.hpp"
#include "os/native_socket.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/free_port.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "rtpm/transport/stream.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"
#include "rtpm/transport/wait_set.hpp"
#include "rtpm/wire/medium.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport {
namespace {

using rtpm::test::free_port;

using namespace test;
using namespace std::chrono_literals;

constexpr const char* kHere = "127.0.0.1";
// A reserved block of addresses without hosts (RFC 5737).
constexpr const char* kNobodysAddress = "192.0.2.1";

UdpPort open_udp(std::uint16_t port) {
  auto opened = UdpPort::open({.port = port});
  EXPECT_TRUE(opened) << opened.error().text();
  return std::move(*opened);
}

/// Waits for the next datagram.
std::optional<Bytes> await_datagram(UdpPort& port, std::size_t capacity = 2000) {
  Bytes buffer(capacity);
  std::optional<Bytes> bytes;
  static_cast<void>(rtpm::test::await([&] {
    const auto datagram = port.receive(buffer);
    if (datagram) bytes = copy_of(datagram->bytes());
    return datagram.has_value();
  }));
  return bytes;
}

TEST(TcpListener, AcceptsWithoutWaiting) {
  auto listener = TcpListener::open(kHere, 0);
  ASSERT_TRUE(listener);
  EXPECT_FALSE(listener->accept().socket.is_open()) << "no client connects";
  const auto client = open_tcp_transport(kHere, listener->port(), 0, 1000, rt::now() + 20s);
  ASSERT_TRUE(client) << client.error().text();
  ASSERT_TRUE(rtpm::test::await([&] { return wait_readable(listener->descriptor(), rt::now()); }));
  EXPECT_TRUE(listener->accept().socket.is_open());
}

TEST(UdpPort, IsSharedByTheLanesOfOneServer) {
  const std::uint16_t number = free_port();
  const std::array<LanePortConfig, 2> lanes{LanePortConfig{}, {.priority = 100, .low = 100}};
  const auto ports = open_lane_ports({.port = number}, lanes, rt::RealtimeMode::kOff);
  ASSERT_TRUE(ports) << ports.error().text();
  EXPECT_EQ(ports->size(), 2U);
  EXPECT_FALSE(UdpPort::open({.port = number})) << "but not by other servers";
}

TEST(UdpPort, KeepsAnAwaitedDatagramForTheNextReceive) {
  const std::uint16_t number = free_port();
  UdpPort port = open_udp(number);
  Bytes buffer(2000);
  auto client = open_udp_transport(kHere, number, 0);
  ASSERT_TRUE(client && (*client)->send(Bytes(3)) && (*client)->send(Bytes(4)));
  ASSERT_TRUE(port.await(buffer));
  EXPECT_TRUE(port.await(buffer)) << "and does not take a second one over it";
  EXPECT_EQ(port.receive(buffer)->bytes().size(), 3u);
  EXPECT_EQ(await_datagram(port)->size(), 4u);
  EXPECT_FALSE(port.receive(buffer)) << "there were two";
}

TEST(UdpPort, AwaitsADatagramForItsBlockTime) {
  UdpPort port = open_udp(free_port());
  Bytes buffer(2000);
  const MonotonicTime begin = rt::now();
  EXPECT_FALSE(port.await(buffer));
  EXPECT_GE(rt::now() - begin, kBlockTime);
}

TEST(UdpPort, IsWokenAtAnyAddress) {
  for (const char* host : {kHere, "any"}) {
    const std::uint16_t number = free_port();
    auto port = UdpPort::open({.host = host, .port = number});
    ASSERT_TRUE(port) << port.error().text();
    Bytes buffer(2000);
    port->wake();
    auto client = open_udp_transport(kHere, number, 0);
    ASSERT_TRUE(client && (*client)->send(Bytes(3)));
    EXPECT_FALSE(port->await(buffer)) << "the wake-up comes first";
    EXPECT_TRUE(port->await(buffer));
  }
}

TEST(Host, WithoutARouteIsNoShortage) {
  const auto client = open_udp_transport("255.255.255.255", 4711, 0);
  ASSERT_FALSE(client);
  expect_text(client.error().text(), {"255.255.255.255:4711 can't be reached over UDP", "Remedy"});
  EXPECT_FALSE(is_shortage(client.error().cause.value()));
}

TEST(Datagram, LargerThanAFrameIsDetectedOnBothSides) {
  const std::uint16_t number = free_port();
  UdpPort port = open_udp(number);
  auto client = open_udp_transport(kHere, number, 0);
  ASSERT_TRUE(client);
  const Bytes too_large = frame_of(5000);
  ASSERT_TRUE((*client)->send(too_large));
  Bytes buffer(wire::kDatagramFrameSizeMax + 1);
  ASSERT_TRUE(wait_readable(port.descriptor(), rt::now() + 20s));
  const auto datagram = port.receive(buffer);
  ASSERT_TRUE(datagram);
  EXPECT_EQ(wire::decode_frame(datagram->bytes()).error(), wire::DropReason::kBadLength);

  ASSERT_TRUE(port.send(datagram->peer(), too_large));
  ASSERT_TRUE(wait_readable((*client)->descriptor(), rt::now() + 20s));
  const auto received = (*client)->receive();
  ASSERT_TRUE(received);
  EXPECT_EQ(wire::decode_frame(*received).error(), wire::DropReason::kBadLength);
}

TEST(UdpTransport, ReportsAPortWithoutAServer) {
  const auto client = open_udp_transport(kHere, free_port(), 0);
  ASSERT_TRUE(client) << "nothing is sent yet";
  ASSERT_TRUE((*client)->send(frame_of(0)));
  ASSERT_TRUE(wait_readable((*client)->descriptor(), rt::now() + 20s));
  const auto received = (*client)->receive();
  ASSERT_FALSE(received);
  EXPECT_EQ(received.error(), IoError::kRefused);
  EXPECT_EQ((*client)->receive().error(), IoError::kNothing) << "it is reported once";
}

TEST(UdpTransport, ReportsWhetherItsPeerIsOnThisHost) {
  const auto here = open_udp_transport(kHere, free_port(), 0);
  ASSERT_TRUE(here);
  EXPECT_TRUE((*here)->is_on_host());
  const auto another = open_udp_transport("127.3.2.1", free_port(), 0);
  ASSERT_TRUE(another);
  EXPECT_TRUE((*another)->is_on_host());
  const auto away = open_udp_transport(kNobodysAddress, free_port(), 0);
  if (!away) GTEST_SKIP() << "this host has no route to another: " << away.error().text();
  EXPECT_FALSE((*away)->is_on_host());
}

// If await() may block in the receive itself, it still ends in time, and takes arriving datagrams.
TEST(UdpTransport, AwaitsUntilItsDeadline) {
  const std::uint16_t number = free_port();
  UdpPort port = open_udp(number);
  auto client = open_udp_transport(kHere, number, 0);
  ASSERT_TRUE(client);
  ASSERT_TRUE(may_block_until(rt::now() + 40ms, kBlockTimeShort));
  EXPECT_EQ((*client)->await(rt::now() + 40ms).error(), IoError::kNothing);
  ASSERT_TRUE((*client)->send(frame_of(1)));
  ASSERT_TRUE(wait_readable(port.descriptor(), rt::now() + 20s));
  Bytes buffer(2000);
  const auto datagram = port.receive(buffer);
  ASSERT_TRUE(datagram);
  ASSERT_TRUE(port.send(datagram->peer(), frame_of(2)));
  const auto received = (*client)->await(rt::now() + 20s);
  ASSERT_TRUE(received);
  EXPECT_EQ(copy_of(*received), frame_of(2));
}

TEST(UdpTransport, ReceivesOnlyFromItsServer) {
  const std::uint16_t number = free_port();
  UdpPort port = open_udp(number);
  auto client = open_udp_transport(kHere, number, 0);
  ASSERT_TRUE(client);
  const std::uint16_t own = own_address((*client)->descriptor()).port();
  auto stranger = open_udp_transport(kHere, own, 0);
  ASSERT_TRUE(stranger);
  ASSERT_TRUE((*stranger)->send(frame_of(1)));
  ASSERT_TRUE((*client)->send(frame_of(2)));
  ASSERT_TRUE(await_datagram(port));
  EXPECT_EQ((*client)->receive().error(), IoError::kNothing);
}

// A listener that never accepts, with a queue of one: further connections get no answer.
TEST(TcpTransport, GivesUpAtItsDeadline) {
  const Descriptor listener = os::open_socket(AF_INET, SOCK_STREAM, os::Blocking::kYes);
  ASSERT_EQ(bind_to(listener.number(), *address_of(kHere, 0)), 0);
  ASSERT_EQ(listen(listener.number(), 0), 0);
  const std::uint16_t number = own_address(listener.number()).port();
  const auto in_the_queue = open_tcp_transport(kHere, number, 0, 1000, rt::now() + 20s);
  ASSERT_TRUE(in_the_queue);
  const MonotonicTime deadline = rt::now() + 20ms;
  const auto client = open_tcp_transport(kHere, number, 0, 1000, deadline);
  EXPECT_GE(rt::now(), deadline);
  ASSERT_FALSE(client);
  expect_text(
      client.error().text(),
      {"no server answers at TCP 127.0.0.1:" + std::to_string(number), "timed out", "Remedy"});
}

// A lane sends the window of a large reply without waiting, and drops a peer whose buffers are
// full. That must not happen to a client that is only slightly late, on a system with the usual
// limits.
TEST(TcpTransport, BuffersAWindowOfALargeMessage) {
  auto listener = TcpListener::open(kHere, 0);
  ASSERT_TRUE(listener);
  const auto late_reader =
      open_tcp_transport(kHere, listener->port(), 0, wire::kStreamPayloadSizeMax, rt::now() + 20s);
  ASSERT_TRUE(late_reader);
  ASSERT_TRUE(wait_readable(listener->descriptor(), rt::now() + 20s));
  Descriptor socket = listener->accept().socket;
  // Sets Linux's default limit (net.core.wmem_max), even if this machine has another one.
  const int usual_limit = 212'992;
  ASSERT_EQ(setsockopt(socket.number(), SOL_SOCKET, SO_SNDBUF, &usual_limit, sizeof usual_limit),
            0);
  FrameStream served(std::move(socket), wire::kStreamPayloadSizeMax);
  for (std::uint32_t i = 0; i < wire::window_of(wire::Medium::kStream); ++i) {
    EXPECT_TRUE(served.send(frame_of(wire::kStreamPayloadSizeMax, 0, i), kAlready))
        << "fragment " << i;
  }
}

// Sooner or later the system gives a client the port of a server that has ended.
TEST(ClientTransport, IsNeverItsOwnPeer) {
  const std::uint16_t number = free_port();
  constexpr int kTryCountMax = 400'000;  // The system has some 28 000 ports.
  int count = 0;
  while (count < kTryCountMax && open_udp_transport(kHere, number, 0))
    ++count;
  EXPECT_LT(count, kTryCountMax) << "the client got the port itself and connected to itself";
}

}  // namespace
}  // namespace rtpm::transport
