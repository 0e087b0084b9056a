#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/test/sockets.hpp"
#include "rtpm/test/text.hpp"
#include "rtpm/transport/error.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/wire/header.hpp"

/// Frames for the tests of the transports.
namespace rtpm::transport {

inline void PrintTo(IoError error, std::ostream* out) {
  static constexpr std::array<const char*, 6> kNames{"nothing", "full",   "refused",
                                                     "closed",  "failed", "broken"};
  *out << kNames[static_cast<std::size_t>(error)];
}

namespace test {

using rtpm::test::expect_text;

using Bytes = std::vector<std::byte>;

[[nodiscard]] inline Bytes copy_of(ConstBytes bytes) {
  return {bytes.begin(), bytes.end()};
}

/// A call of `priority` whose payload of `size` bytes identifies it.
[[nodiscard]] inline Bytes frame_of(std::size_t size, Priority priority = 0,
                                    std::uint32_t call_id = 1) {
  wire::Header header;
  header.priority = priority;
  header.call_id = call_id;
  header.payload_size = header.message_size = static_cast<std::uint32_t>(size);
  Bytes frame(wire::kHeaderSize + size);
  wire::encode(header, frame.data());
  for (std::size_t i = 0; i < size; ++i) {
    frame[wire::kHeaderSize + i] = static_cast<std::byte>(call_id + i);
  }
  return frame;
}

/// Two ends of a stream, both non-blocking.
[[nodiscard]] inline std::pair<Descriptor, Descriptor> stream_pair() {
  return rtpm::test::stream_pair();
}

inline void write_all(const Descriptor& to, ConstBytes bytes) {
  ASSERT_EQ(send(to.number(), bytes.data(), bytes.size(), MSG_NOSIGNAL),
            static_cast<ssize_t>(bytes.size()));
}

}  // namespace test
}  // namespace rtpm::transport
