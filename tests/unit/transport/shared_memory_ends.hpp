#pragma once

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "frames.hpp"
#include "raw_shared_client.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/transport/shared_memory.hpp"

/// Both ends of a connection through shared memory, or one end and a misbehaving client.
namespace rtpm::transport::test {

using rtpm::test::await;

/// An address for this test process alone.
inline SharedMemoryAddress own_address(std::string folder = {}) {
  static std::atomic<int> serial{0};
  return {"test-" + std::to_string(getpid()) + "-" + std::to_string(++serial), 4711,
          std::move(folder)};
}
inline std::string abstract_name(const SharedMemoryAddress& address) {
  return "rtpm/" + address.host + ":" + std::to_string(address.port);
}

inline MonotonicTime soon() {
  return rt::now() + std::chrono::seconds{20};
}

/// The listener of a server that accepts clients on request.
struct Host {
  explicit Host(SharedMemoryAddress its_address = own_address())
      : address(std::move(its_address)), listener(open(address)) {}

  static SharedMemoryListener open(const SharedMemoryAddress& address) {
    auto opened = SharedMemoryListener::open(address);
    EXPECT_TRUE(opened) << opened.error().text();
    return std::move(*opened);
  }
  /// Waits for the next client's request and answers it.
  std::optional<SharedMemoryClient> welcome() {
    EXPECT_TRUE(wait_readable(listener.descriptor(), soon()));
    Descriptor socket = listener.accept().socket;
    EXPECT_TRUE(socket.is_open());
    EXPECT_TRUE(wait_readable(socket.number(), soon()));
    auto client = welcome_shared_memory_client(std::move(socket));
    if (!client.connection) return std::nullopt;
    return client;
  }

  SharedMemoryAddress address;
  SharedMemoryListener listener;
};

/// Both ends of a connection, set up as they would be.
struct Pair {
  explicit Pair(Host& host, Priority priority = 0) {
    std::thread opener([&] {
      auto opened = open_shared_memory_transport(host.address, priority, soon());
      EXPECT_TRUE(opened) << opened.error().text();
      if (opened) client = std::move(*opened);
    });
    auto welcomed = host.welcome();
    opener.join();
    EXPECT_TRUE(welcomed);
    if (!welcomed) return;
    given_priority = welcomed->priority;
    connection = std::move(welcomed->connection);
  }
  std::unique_ptr<ClientTransport> client;
  std::unique_ptr<Connection> connection;
  Priority given_priority{};
};

/// A server's end, and a client that implements only the specification.
class RawPair {
 public:
  explicit RawPair(Host& host) {
    socket = connect_to_name(abstract_name(host.address));
    EXPECT_TRUE(socket.is_open());
    write_all(socket, request_of(0));
    auto client = host.welcome();
    EXPECT_TRUE(client);
    if (client) connection = std::move(client->connection);
    RawMessage answer = take_message(socket.number());
    EXPECT_EQ(answer.bytes.size(), kAnswerSize);
    memory.emplace(std::move(answer.descriptor), load_le<std::uint32_t>(answer.bytes.data() + 8));
    event = std::move(answer.second);
    EXPECT_TRUE(event.is_open());
  }
  /// The number of pending rings.
  int take_bells() const {
    int count = 0;
    std::byte bell{};
    while (recv(socket.number(), &bell, sizeof bell, MSG_DONTWAIT) == 1)
      ++count;
    return count;
  }
  Descriptor socket;
  Descriptor event;
  std::optional<RawMemory> memory;
  std::unique_ptr<Connection> connection;
};

template <class End>
expected<Bytes, IoError> receive(End& end) {
  const auto frame = end.receive();
  if (!frame) return unexpected{frame.error()};
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(frame->data()) % 16, 0u);
  return copy_of(*frame);
}
template <class End>
void expect_frame(End& end, const Bytes& wanted) {
  const auto frame = receive(end);
  ASSERT_TRUE(frame) << testing::PrintToString(frame.error());
  EXPECT_EQ(*frame, wanted);
}
template <class End>
void expect_error(End& end, IoError error) {
  const auto frame = receive(end);
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error(), error);
}

}  // namespace rtpm::transport::test
