#include "rtpm/transport/broadcast_memory.hpp"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <climits>
#include <cstdio>
#include <cstring>
#include <string>

#include "rtpm/rt/clock.hpp"
#include "shared_memory/memory.hpp"
#include "shared_memory/unix_socket.hpp"
#include "sockets/native.hpp"

#ifndef F_SEAL_FUTURE_WRITE
#define F_SEAL_FUTURE_WRITE 0x0010
#endif

namespace rtpm::transport {
namespace {

// The byte that accompanies the descriptor.
constexpr std::byte kHere{0x42};
constexpr std::size_t kBellSize = 4096;

SetupError not_made(const std::string& cause) {
  return {"memory to broadcast in can't be made", cause,
          "raise the limits of memory and open files (ulimit -v, ulimit -n), or do without"};
}

SetupError not_got(const std::string& cause) {
  return {"the memory to read from is not given", cause,
          "see that the program that writes it runs, as the same user"};
}

// "\0rtpm-broadcast/0123456789abcdef".
socklen_t to_native(std::uint64_t id, sockaddr_un& native) noexcept {
  native = {};
  native.sun_family = AF_UNIX;
  const int size = std::snprintf(native.sun_path + 1, sizeof native.sun_path - 1,
                                 "rtpm-broadcast/%016llx", static_cast<unsigned long long>(id));
  return static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 +
                                static_cast<std::size_t>(size));
}

}  // namespace

bool offers_broadcast_memory() noexcept {
  return true;
}

expected<BroadcastMemory, SetupError> BroadcastMemory::make(std::size_t size) {
  auto bell = BroadcastBell::make();
  if (!bell) return unexpected{not_made(std::strerror(errno))};
  const Descriptor writable = make_memory("rtpm-broadcast", size);
  if (!writable.is_open()) return unexpected{not_made(std::strerror(errno))};
  SharedMapping mapping(writable.number(), size);
  if (mapping.bytes().empty()) return unexpected{not_made(std::strerror(errno))};
  // This mapping stays writable; from here on no other can be, and the size is fixed.
  Descriptor readable;
  if (seal_memory(writable.number(), F_SEAL_FUTURE_WRITE)) {
    const std::string path = "/proc/self/fd/" + std::to_string(writable.number());
    readable = Descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  }
  if (!readable.is_open()) return unexpected{not_made(std::strerror(errno))};
  return BroadcastMemory(std::move(readable), std::move(mapping), std::move(bell->first),
                         std::move(bell->second));
}

expected<BroadcastDoor, SetupError> BroadcastDoor::open(std::uint64_t id) {
  sockaddr_un native{};
  const socklen_t size = to_native(id, native);
  Descriptor socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!socket.is_open() ||
      bind(socket.number(), reinterpret_cast<const sockaddr*>(&native), size) != 0 ||
      listen(socket.number(), 128) != 0) {
    return unexpected{not_made(std::strerror(errno))};
  }
  return BroadcastDoor(std::move(socket), spare_descriptor());
}

void BroadcastDoor::let_in(const BroadcastMemory& memory) noexcept {
  while (true) {
    const Accepted accepted = accept_or_turn_away(socket_.number(), spare_);
    // A reader that is turned away gets its events by another path.
    if (accepted.shortage != 0 && !accepted.still_waits) continue;
    const Descriptor& asking = accepted.socket;
    if (!asking.is_open()) return;
    if (!is_trusted(asking.number())) continue;
    // One message always fits a new socket; if the reader has left, it needs none.
    static_cast<void>(send_message(asking.number(), std::array{kHere},
                                   std::array{memory.descriptor(), memory.bell_descriptor()}));
  }
}

expected<BroadcastView, SetupError> BroadcastView::open(std::uint64_t id, MonotonicTime deadline) {
  sockaddr_un native{};
  const socklen_t size = to_native(id, native);
  const Descriptor socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!socket.is_open() ||
      connect(socket.number(), reinterpret_cast<const sockaddr*>(&native), size) != 0) {
    return unexpected{not_got(std::strerror(errno))};
  }
  if (!is_trusted(socket.number())) return unexpected{not_got("the writer is another user's")};
  while (!wait_readable(socket.number(), deadline)) {
    if (rt::now() >= deadline) return unexpected{not_got("the writer does not answer")};
  }
  std::array<std::byte, 2> message{};
  const ReceivedMessage received = receive_message(socket.number(), message);
  const int memory = received.descriptors[0].number();
  const std::size_t memory_size = sealed_size(memory);
  if (received.size != 1 || memory_size == 0) return unexpected{not_got("the writer refused")};
  auto bell = BroadcastBell::map(received.descriptors[1].number());
  if (!bell) return unexpected{not_got("it has no bell")};
  SharedMapping mapping(memory, memory_size, SharedMapping::Access::kRead);
  if (mapping.bytes().empty()) return unexpected{not_got(std::strerror(errno))};
  return BroadcastView(std::move(mapping), std::move(*bell));
}

std::optional<std::pair<BroadcastBell, Descriptor>> BroadcastBell::make() noexcept {
  Descriptor descriptor = make_memory("rtpm-bell", kBellSize);
  if (!descriptor.is_open() || !seal_memory(descriptor.number())) return std::nullopt;
  auto bell = map(descriptor.number());
  if (!bell) return std::nullopt;
  return std::pair(std::move(*bell), std::move(descriptor));
}

std::optional<BroadcastBell> BroadcastBell::map(int descriptor) noexcept {
  if (sealed_size(descriptor) < kBellSize) return std::nullopt;
  // The word starts at 0, like all fresh memory.
  SharedMapping mapping(descriptor, kBellSize);
  if (mapping.bytes().empty()) return std::nullopt;
  return BroadcastBell(std::move(mapping));
}

void BroadcastBell::ring(std::uint32_t bits) noexcept {
  // SYNC POINT bell: the writer stores the event, then changes the word; a sleeper loads the word
  // before its last check.
  word().fetch_add(1, std::memory_order_seq_cst);
  wake_on_word(word(), INT_MAX, bits);
}

void BroadcastBell::sleep(std::uint32_t seen, std::uint32_t bits, MonotonicTime until) noexcept {
  sleep_on_word(word(), seen, std::min(until, rt::now() + kBellLookInterval), bits);
}

}  // namespace rtpm::transport
