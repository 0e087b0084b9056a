#include "rtpm/transport/broadcast_memory.hpp"

#include <fcntl.h>
#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <climits>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <string>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/native_time.hpp"
#include "shared_memory/unix_socket.hpp"
#include "sockets/accept.hpp"

#ifndef F_SEAL_FUTURE_WRITE
#define F_SEAL_FUTURE_WRITE 0x0010
#endif

namespace rtpm::transport {
namespace {

// The one byte that comes with the descriptor.
constexpr std::byte kHere{0x42};
constexpr off_t kBellSize = 4096;

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

expected<BroadcastMemory, SetupError> BroadcastMemory::make(std::size_t size) {
  auto bell = BroadcastBell::make();
  if (!bell) return unexpected{not_made(std::strerror(errno))};
  const Descriptor writable(memfd_create("rtpm-broadcast", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (!writable.is_open() || ftruncate(writable.number(), static_cast<off_t>(size)) != 0) {
    return unexpected{not_made(std::strerror(errno))};
  }
  void* const begin =
      mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, writable.number(), 0);
  if (begin == MAP_FAILED) return unexpected{not_made(std::strerror(errno))};
  const MutableBytes bytes{static_cast<std::byte*>(begin), size};
  // The mapping that there is stays writable; from here on nobody gets another, nor changes the
  // size under those who read.
  const int seals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE | F_SEAL_SEAL;
  const std::string path = "/proc/self/fd/" + std::to_string(writable.number());
  Descriptor readable;
  if (fcntl(writable.number(), F_ADD_SEALS, seals) == 0) {
    readable = Descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  }
  if (!readable.is_open()) {
    const int error = errno;
    munmap(begin, size);
    return unexpected{not_made(std::strerror(error))};
  }
  return BroadcastMemory(std::move(readable), bytes, std::move(bell->first),
                         std::move(bell->second));
}

BroadcastMemory::~BroadcastMemory() {
  if (!bytes_.empty()) munmap(bytes_.data(), bytes_.size());
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
    // A reader that is turned away gets its events otherwise.
    if (accepted.shortage != 0 && !accepted.still_waits) continue;
    const Descriptor& asking = accepted.socket;
    if (!asking.is_open()) return;
    if (!is_trusted(asking.number())) continue;
    // One message always fits a new socket; who left already needs none.
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
  struct stat status {};
  const int memory = received.descriptors[0].number();
  const int seals = fcntl(memory, F_GET_SEALS);
  if (received.size != 1 || seals < 0 || (seals & F_SEAL_SHRINK) == 0 ||
      fstat(memory, &status) != 0 || status.st_size <= 0) {
    return unexpected{not_got("the writer refused")};
  }
  const auto bytes = static_cast<std::size_t>(status.st_size);
  auto bell = BroadcastBell::map(received.descriptors[1].number());
  if (!bell) return unexpected{not_got("it has no bell")};
  void* const begin = mmap(nullptr, bytes, PROT_READ, MAP_SHARED | MAP_POPULATE, memory, 0);
  if (begin == MAP_FAILED) return unexpected{not_got(std::strerror(errno))};
  return BroadcastView(ConstBytes{static_cast<const std::byte*>(begin), bytes}, std::move(*bell));
}

BroadcastView::~BroadcastView() {
  if (!bytes_.empty()) munmap(const_cast<std::byte*>(bytes_.data()), bytes_.size());
}

std::optional<std::pair<BroadcastBell, Descriptor>> BroadcastBell::make() noexcept {
  Descriptor descriptor(memfd_create("rtpm-bell", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (!descriptor.is_open() || ftruncate(descriptor.number(), kBellSize) != 0 ||
      fcntl(descriptor.number(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0) {
    return std::nullopt;
  }
  auto bell = map(descriptor.number());
  if (!bell) return std::nullopt;
  return std::pair(std::move(*bell), std::move(descriptor));
}

std::optional<BroadcastBell> BroadcastBell::map(int descriptor) noexcept {
  struct stat status {};
  const int seals = fcntl(descriptor, F_GET_SEALS);
  if (seals < 0 || (seals & F_SEAL_SHRINK) == 0 || fstat(descriptor, &status) != 0 ||
      status.st_size < kBellSize) {
    return std::nullopt;
  }
  void* const begin =
      mmap(nullptr, kBellSize, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, descriptor, 0);
  if (begin == MAP_FAILED) return std::nullopt;
  // In fresh memory the word is zero, which is how it begins.
  return BroadcastBell(static_cast<std::atomic<std::uint32_t>*>(begin));
}

BroadcastBell::~BroadcastBell() {
  if (word_ != nullptr) munmap(word_, kBellSize);
}

void BroadcastBell::ring(std::uint32_t bits) noexcept {
  // SYNC POINT bell: what there is to see was written before the word changes; who sleeps took the
  // word before its last look.
  word_->fetch_add(1, std::memory_order_seq_cst);
  syscall(SYS_futex, word_, FUTEX_WAKE_BITSET, INT_MAX, nullptr, nullptr, bits);
}

void BroadcastBell::sleep(std::uint32_t seen, std::uint32_t bits, MonotonicTime until) noexcept {
  const timespec time = rt::to_timespec(std::min(until, rt::now() + kBellLookInterval));
  syscall(SYS_futex, word_, FUTEX_WAIT_BITSET, seen, &time, nullptr, bits);
}

}  // namespace rtpm::transport
