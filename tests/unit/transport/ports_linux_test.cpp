#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "frames.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/child.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"
#include "rtpm/transport/wait_set.hpp"
#include "sockets/native.hpp"

// Ports when no descriptor is left, and how Linux marks their traffic.
namespace rtpm::transport {
namespace {

using namespace std::chrono_literals;

constexpr const char* kHere = "127.0.0.1";

// Waiting connections would wake the acceptor for ever.
TEST(TcpListener, RefusesConnectionsWithoutAFreeDescriptor) {
  const rtpm::test::ChildResult child = rtpm::test::run_in_child([]() -> std::string {
    auto listener = TcpListener::open(kHere, 0);
    if (!listener) return listener.error().text();
    std::vector<std::unique_ptr<ClientTransport>> clients;
    for (int i = 0; i < 3; ++i) {
      clients.push_back(
          std::move(*open_tcp_transport(kHere, listener->port(), 0, 1000, rt::now() + 20s)));
    }
    const rlimit few{64, 64};
    setrlimit(RLIMIT_NOFILE, &few);
    while (dup(STDERR_FILENO) >= 0) {
    }
    for (int i = 0; i < 3; ++i) {
      if (!wait_readable(listener->descriptor(), rt::now() + 20s)) return "no connection waits";
      const Accepted accepted = listener->accept();
      if (accepted.socket.is_open()) return "there was a descriptor";
      if (accepted.shortage != EMFILE || accepted.still_waits) return "it does not say what it did";
    }
    if (wait_readable(listener->descriptor(), rt::now())) return "a connection still waits";
    for (const auto& client : clients) {
      if (!wait_readable(client->descriptor(), rt::now() + 20s)) return "a client waits";
      if (client->receive().error() != IoError::kClosed) return "a client does not see its end";
    }
    return "";
  });
  EXPECT_EQ(child.said, "");
  EXPECT_EQ(child.status, 0) << child.errors;
}

// The acceptor must not be woken repeatedly meanwhile.
TEST(TcpListener, ReportsAConnectionThatStillWaits) {
  const rtpm::test::ChildResult child = rtpm::test::run_in_child([]() -> std::string {
    const auto listener = TcpListener::open(kHere, 0);
    if (!listener) return listener.error().text();
    const auto client = open_tcp_transport(kHere, listener->port(), 0, 1000, rt::now() + 20s);
    if (!client) return client.error().text();
    const rlimit few{64, 64};
    setrlimit(RLIMIT_NOFILE, &few);
    while (dup(STDERR_FILENO) >= 0) {
    }
    if (!wait_readable(listener->descriptor(), rt::now() + 20s)) return "no connection waits";
    Descriptor spare;
    const Accepted accepted = accept_or_turn_away(listener->descriptor(), spare);
    if (accepted.shortage != EMFILE || !accepted.still_waits) return "it does not say so";
    return wait_readable(listener->descriptor(), rt::now()) ? "" : "the connection no longer waits";
  });
  EXPECT_EQ(child.said, "");
  EXPECT_EQ(child.status, 0) << child.errors;
}

// Each error names the shortage and its remedy, instead of claiming that there is no server.
TEST(Descriptors, AreReportedWhenExhausted) {
  const rtpm::test::ChildResult child = rtpm::test::run_in_child([]() -> std::string {
    const rlimit few{64, 64};
    setrlimit(RLIMIT_NOFILE, &few);
    while (dup(STDERR_FILENO) >= 0) {
    }
    const std::vector<SetupError> errors{
        open_udp_transport(kHere, 4711, 0).error(),
        open_tcp_transport(kHere, 4711, 0, 1000, rt::now() + 20s).error(),
        open_shared_memory_transport({kHere, 4711, ""}, 0, rt::now() + 20s).error(),
        UdpPort::open({.host = kHere}).error(),
        TcpListener::open(kHere, 0).error(),
        WaitSet::open(1).error()};
    std::string wrong;
    for (const SetupError& error : errors) {
      const bool is_named =
          error.text().find("Too many open files") != std::string::npos &&
          error.text().find("Remedy: raise the limit of open files") != std::string::npos;
      if (!is_named || !is_shortage(error.cause.value())) wrong += error.text() + "\n";
    }
    return wrong;
  });
  EXPECT_EQ(child.said, "");
  EXPECT_EQ(child.status, 0) << child.errors;
}

// The quarters of the range are best effort, AF21, AF41 and EF (hp-11).
TEST(TrafficClass, FollowsThePriority) {
  struct Row {
    int priority, dscp, queue;
  };
  for (const Row row :
       {Row{0, 0, 0}, Row{8191, 0, 0}, Row{8192, 18, 2}, Row{16383, 18, 2}, Row{16384, 34, 4},
        Row{24575, 34, 4}, Row{24576, 46, 6}, Row{32767, 46, 6}}) {
    const auto client = open_udp_transport(kHere, 9, row.priority);
    ASSERT_TRUE(client);
    int type_of_service = -1;
    int queue = -1;
    socklen_t size = sizeof type_of_service;
    getsockopt((*client)->descriptor(), IPPROTO_IP, IP_TOS, &type_of_service, &size);
    getsockopt((*client)->descriptor(), SOL_SOCKET, SO_PRIORITY, &queue, &size);
    EXPECT_EQ(type_of_service >> 2, row.dscp) << row.priority;
    EXPECT_EQ(queue, row.queue) << row.priority;
  }
}

}  // namespace
}  // namespace rtpm::transport
