#pragma once

#include <gtest/gtest.h>

#include <cstdint>

#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"

namespace rtpm::test {

/// A number whose TCP port at 127.0.0.1 is free at this moment.
[[nodiscard]] inline std::uint16_t free_port() {
  const auto listener = transport::TcpListener::open("127.0.0.1", 0);
  EXPECT_TRUE(listener);
  return listener->port();
}

/// Whether a server can take this port of 127.0.0.1 for UDP and TCP at this moment.
[[nodiscard]] inline bool is_free(std::uint16_t port) {
  return transport::TcpListener::open("127.0.0.1", port) &&
         transport::UdpPort::open({.host = "127.0.0.1", .port = port});
}

}  // namespace rtpm::test
