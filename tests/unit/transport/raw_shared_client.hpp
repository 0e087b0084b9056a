#pragma once

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstring>
#include <string>

#include "frames.hpp"
#include "rtpm/rt/clock.hpp"

/// A client of shared memory that implements the specification without RTPM's code, and can violate
/// it.   Source: spec/hprotocol.md#hp-16.
namespace rtpm::transport::test {

inline constexpr std::size_t kRequestSize = 16;
inline constexpr std::size_t kAnswerSize = 32;

/// hp-16.1-1: connects to the abstract name; returns no open descriptor if there is no server.
[[nodiscard]] inline Descriptor connect_to_name(const std::string& name) {
  Descriptor socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path + 1, name.data(), name.size());
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  if (connect(socket.number(), reinterpret_cast<const sockaddr*>(&address), size) != 0) return {};
  return socket;
}

[[nodiscard]] inline Bytes request_of(std::uint16_t priority, std::uint16_t version = 1,
                                      std::uint16_t flags = 0) {
  Bytes request(kRequestSize);
  std::memcpy(request.data(), "HPSM", 4);
  store_le(request.data() + 4, version);
  store_le(request.data() + 6, priority);
  store_le(request.data() + 8, flags);
  return request;
}

/// The bytes and descriptors of one message.
struct RawMessage {
  Bytes bytes;
  Descriptor descriptor;
  Descriptor second;
};
/// Waits for a message; an empty one means the end.
[[nodiscard]] inline RawMessage take_message(int socket) {
  RawMessage message;
  message.bytes.resize(256);
  iovec part{message.bytes.data(), message.bytes.size()};
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(2 * sizeof(int))> control{};
  msghdr header{};
  header.msg_iov = &part;
  header.msg_iovlen = 1;
  header.msg_control = control.data();
  header.msg_controllen = control.size();
  const ssize_t size = recvmsg(socket, &header, MSG_CMSG_CLOEXEC);
  message.bytes.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
  const cmsghdr* const rights = CMSG_FIRSTHDR(&header);
  if (size > 0 && rights != nullptr) {
    int number = -1;
    std::memcpy(&number, CMSG_DATA(rights), sizeof number);
    message.descriptor = Descriptor(number);
    if (rights->cmsg_len == CMSG_LEN(2 * sizeof number)) {
      std::memcpy(&number, CMSG_DATA(rights) + sizeof number, sizeof number);
      message.second = Descriptor(number);
    }
  }
  return message;
}

/// The memory of a connection, as each side sees it.
class RawMemory {
 public:
  RawMemory() = default;
  RawMemory(Descriptor memory, std::size_t to_server_size)
      : memory_(std::move(memory)), to_server_size_(to_server_size) {
    struct stat status {};
    EXPECT_EQ(fstat(memory_.number(), &status), 0);
    size_ = static_cast<std::size_t>(status.st_size);
    void* const at = mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_SHARED, memory_.number(), 0);
    EXPECT_NE(at, MAP_FAILED);
    begin_ = static_cast<std::byte*>(at);
  }
  RawMemory(const RawMemory&) = delete;
  RawMemory& operator=(const RawMemory&) = delete;
  ~RawMemory() {
    if (begin_ != nullptr) munmap(begin_, size_);
  }

  [[nodiscard]] std::atomic_ref<std::uint64_t> word(std::size_t offset) const {
    return std::atomic_ref<std::uint64_t>(*reinterpret_cast<std::uint64_t*>(begin_ + offset));
  }
  [[nodiscard]] std::byte* at(std::size_t offset) const { return begin_ + offset; }
  [[nodiscard]] auto to_server_tail() const { return word(0); }
  [[nodiscard]] auto to_server_head() const { return word(64); }
  [[nodiscard]] auto to_server_sleeping() const { return word(128); }
  [[nodiscard]] auto to_client_tail() const { return word(256); }
  [[nodiscard]] auto to_client_head() const { return word(256 + 64); }
  [[nodiscard]] auto to_client_sleeping() const { return word(256 + 128); }
  [[nodiscard]] std::atomic_ref<std::uint32_t> to_server_taken() const { return number(72); }
  [[nodiscard]] std::atomic_ref<std::uint32_t> to_client_taken() const { return number(256 + 72); }
  [[nodiscard]] std::byte* to_server_slot(std::uint32_t record) const {
    return begin_ + 4096 + record % 16 * 256;
  }
  [[nodiscard]] std::byte* to_client_slot(std::uint32_t record) const {
    return begin_ + 8192 + record % 16 * 256;
  }
  [[nodiscard]] std::byte* to_server_data() const { return begin_ + 12'288; }
  [[nodiscard]] std::byte* to_client_data() const { return begin_ + 12'288 + to_server_size_; }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] int descriptor() const { return memory_.number(); }

  /// Writes the first record to the server into the ring; its size and number may be false.
  void write_first(const Bytes& frame, std::uint64_t stated_size,
                   std::uint64_t stated_number = 1) const {
    write_at(to_server_data(), frame, stated_size, stated_number);
    to_server_tail() = (8 + frame.size() + 63) / 64 * 64;
  }
  /// Writes the first record to the server into its slot; its size and number may be false.
  void write_to_slot(const Bytes& frame, std::uint64_t stated_size,
                     std::uint64_t stated_number = 1) const {
    write_at(to_server_slot(1), frame, stated_size, stated_number);
  }

 private:
  [[nodiscard]] std::atomic_ref<std::uint32_t> number(std::size_t offset) const {
    return std::atomic_ref<std::uint32_t>(*reinterpret_cast<std::uint32_t*>(begin_ + offset));
  }
  static void write_at(std::byte* to, const Bytes& frame, std::uint64_t size,
                       std::uint64_t number) {
    std::memcpy(to + 8, frame.data(), frame.size());
    std::atomic_ref<std::uint64_t>(*reinterpret_cast<std::uint64_t*>(to)) = number << 32 | size;
  }

  Descriptor memory_;
  std::size_t to_server_size_ = 0;
  std::size_t size_ = 0;
  std::byte* begin_ = nullptr;
};

}  // namespace rtpm::transport::test
