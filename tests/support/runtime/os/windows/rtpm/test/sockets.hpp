#pragma once

#include <gtest/gtest.h>

#include <utility>

#include <sys/socket.h>
#include "rtpm/rt/clock.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/transport/tcp.hpp"

namespace rtpm::test {

/// Opens a socket that does not block; −1 if the system refuses.
[[nodiscard]] inline int open_socket(int family, int type) {
  transport::os::start_winsock();
  const SOCKET socket = ::socket(family, type, 0);
  u_long is_non_blocking = 1;
  ioctlsocket(socket, static_cast<long>(FIONBIO), &is_non_blocking);
  return static_cast<int>(socket);
}

/// Two ends of a stream, both non-blocking: a connection to itself, as there are no pairs.
[[nodiscard]] inline std::pair<transport::Descriptor, transport::Descriptor> stream_pair() {
  auto listener = transport::TcpListener::open("127.0.0.1", 0);
  EXPECT_TRUE(listener);
  transport::Descriptor far(open_socket(AF_INET, SOCK_STREAM));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(listener->port());
  static_cast<void>(connect(far.number(), reinterpret_cast<sockaddr*>(&address), sizeof address));
  transport::prepare_stream(far.number());
  EXPECT_TRUE(
      transport::wait_readable(listener->descriptor(), rt::now() + std::chrono::seconds{20}));
  return {listener->accept().socket, std::move(far)};
}

}  // namespace rtpm::test
