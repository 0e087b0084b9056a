#pragma once

#include <array>
#include <span>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/transport/socket.hpp"

struct sockaddr_un;

/// UNIX sockets for shared memory.
namespace rtpm::transport {

/// The file of a server's socket; empty if it has an abstract name.
[[nodiscard]] std::string socket_file_of(const SharedMemoryAddress& address);
/// "UNIX socket @rtpm/127.0.0.1:4711", for people.
[[nodiscard]] std::string in_words(const SharedMemoryAddress& address);

/// Fills in the address; returns its size, or 0 if the name is too long.
[[nodiscard]] unsigned to_native(const SharedMemoryAddress& address, sockaddr_un& native) noexcept;

/// Whether the peer belongs to this process's user, root or one of `others`, as the kernel recorded
/// at its connect or listen.
/// @source   spec/hprotocol.md#hp-16.1
[[nodiscard]] bool is_trusted(int socket, std::span<const std::uint32_t> others = {}) noexcept;

/// The most descriptors in a message.
inline constexpr std::size_t kDescriptorCountMax = 2;

/// Sends one message with descriptors; false if it was not sent completely.
[[nodiscard]] bool send_message(int socket, ConstBytes message,
                                std::span<const int> descriptors) noexcept;

struct ReceivedMessage {
  std::size_t size = 0;  ///< 0 if there is none, or the connection has ended.
  std::array<Descriptor, kDescriptorCountMax> descriptors;
  bool lacks_descriptors = false;  ///< Some were lost because this process had none left.
};
/// Receives one message into `to`, with its descriptors. Never blocks.
[[nodiscard]] ReceivedMessage receive_message(int socket, MutableBytes to) noexcept;

}  // namespace rtpm::transport
