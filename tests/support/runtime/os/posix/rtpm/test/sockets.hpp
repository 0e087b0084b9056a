#pragma once

#include <gtest/gtest.h>
#include <sys/socket.h>

#include <array>
#include <utility>

#include "rtpm/transport/socket.hpp"

namespace rtpm::test {

/// Opens a socket that does not block; −1 if the system refuses.
[[nodiscard]] inline int open_socket(int family, int type) {
  return ::socket(family, type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
}

/// Two ends of a stream, both non-blocking.
[[nodiscard]] inline std::pair<transport::Descriptor, transport::Descriptor> stream_pair() {
  std::array<int, 2> ends{-1, -1};
  EXPECT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends.data()), 0);
  return {transport::Descriptor(ends[0]), transport::Descriptor(ends[1])};
}

}  // namespace rtpm::test
