#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "rtpm/rt/clock.hpp"
#include "rtpm/transport/multicast.hpp"

namespace rtpm::events::test {

inline constexpr const char* kLoopback = "127.0.0.1";
inline constexpr const char* kNeedsMulticast = "needs multicast on the loopback interface";

/// A multicast group for this test alone, so that it gets no events of tests that run beside it.
inline transport::MulticastGroup group_of_mine() {
  static const auto kPort = static_cast<std::uint16_t>(20'000 + to_ns(rt::now()) / 1000 % 40'000);
  return {.group = "239.255.42.99", .port = kPort, .interface = kLoopback, .hops = 0};
}

/// Loses each datagram to a multicast group whose number is a multiple of `count`; 0: none.
void lose_every(std::uint32_t count);

/// Whether datagrams sent to the group arrive.
inline bool has_multicast() {
  const auto group = group_of_mine();
  auto receiver = transport::MulticastReceiver::open(group);
  auto sender = transport::MulticastSender::open(group);
  return receiver && sender && sender->send(std::array<std::byte, 1>{}) &&
         receiver->wait(rt::now() + std::chrono::seconds{1});
}

}  // namespace rtpm::events::test
