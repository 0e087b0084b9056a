#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/error.hpp"
#include "rtpm/transport/socket.hpp"

/// Memory that one process writes and many read. A reader can't write it, not even one that means
/// harm, and the writer never looks at anything that a reader could change. It has no name, so
/// nothing is left of it; readers get it over a UNIX socket.
namespace rtpm::transport {

/// The writer's side.
/// Ownership: the memory, in this process; readers keep theirs.   Threads: any.   Set-up only.
class BroadcastMemory {
 public:
  /// `size` bytes of zeros, all of them in memory.
  /// Errors: no memory or descriptor left; a kernel that can't take the right to write away (before
  /// Linux 5.1).
  [[nodiscard]] static expected<BroadcastMemory, TransportError> make(std::size_t size);
  BroadcastMemory(BroadcastMemory&& other) noexcept
      : descriptor_(std::move(other.descriptor_)), bytes_(std::exchange(other.bytes_, {})) {}
  BroadcastMemory& operator=(BroadcastMemory&&) = delete;
  ~BroadcastMemory();

  [[nodiscard]] MutableBytes bytes() const noexcept { return bytes_; }
  /// To be handed out: it can be mapped for reading only.
  [[nodiscard]] int descriptor() const noexcept { return descriptor_.number(); }

 private:
  BroadcastMemory(Descriptor descriptor, MutableBytes bytes) noexcept
      : descriptor_(std::move(descriptor)), bytes_(bytes) {}
  Descriptor descriptor_;
  MutableBytes bytes_;
};

/// Where readers on this host ask for the memory `id`: an abstract UNIX socket, which reaches as
/// far as the network namespace.   Threads: one at a time.   Set-up only.
class BroadcastDoor {
 public:
  /// Errors: the id is in use; no descriptor left.
  [[nodiscard]] static expected<BroadcastDoor, TransportError> open(std::uint64_t id);
  /// Can be read when somebody asks.
  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }
  /// Gives the memory to all who ask now and are of the same user; never waits for one.
  void let_in(const BroadcastMemory& memory) noexcept;

 private:
  explicit BroadcastDoor(Descriptor socket) noexcept : socket_(std::move(socket)) {}
  Descriptor socket_;
};

/// A reader's side.   Ownership: unmaps at its end.   Threads: any.   Set-up only.
class BroadcastView {
 public:
  /// Asks for the memory `id` on this host.
  /// Errors: nobody there; another user's; no answer by the deadline; no memory left.
  [[nodiscard]] static expected<BroadcastView, TransportError> open(std::uint64_t id,
                                                                    MonotonicTime deadline);
  BroadcastView(BroadcastView&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}
  BroadcastView& operator=(BroadcastView&&) = delete;
  ~BroadcastView();
  [[nodiscard]] ConstBytes bytes() const noexcept { return bytes_; }

 private:
  explicit BroadcastView(ConstBytes bytes) noexcept : bytes_(bytes) {}
  ConstBytes bytes_;
};

/// Sleeps while the word, which may be one that this process can only read, is `value`, until it is
/// woken for one of `bits`, or until `until`; wakes for nothing at times.
/// RT: alloc-free, one syscall.
void sleep_on_broadcast(const std::atomic<std::uint32_t>& word, std::uint32_t value,
                        std::uint32_t bits, MonotonicTime until) noexcept;
/// Wakes all who sleep on the word for one of `bits`, the most urgent first.
/// RT: alloc-free, one syscall, never blocks.
void wake_broadcast(std::atomic<std::uint32_t>& word, std::uint32_t bits) noexcept;

}  // namespace rtpm::transport
