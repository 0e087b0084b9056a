#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/error.hpp"
#include "rtpm/transport/mapping.hpp"
#include "rtpm/transport/socket.hpp"

/// Memory that one process writes and many read. No reader can write it, not even a malicious one,
/// and the writer never loads a value that a reader could change. It has no name, so nothing
/// remains of it. Readers get it over a UNIX socket.
///
/// The bell is a separate word on which readers sleep and which they may write: the kernel's futex
/// is slower for a word that cannot be written, by a fifth of a reader's cost per event. A
/// malicious reader can wake others spuriously, or let them sleep for at most kBellLookInterval.
namespace rtpm::transport {

/// The longest sleep on a bell; a reader then checks the memory without a signal.
inline constexpr Duration kBellLookInterval = std::chrono::milliseconds{100};

/// Whether this system offers it.
[[nodiscard]] bool offers_broadcast_memory() noexcept;

/// This process's mapping of a bell.
/// @threads  any
class BroadcastBell {
 public:
  /// Creates a bell and its descriptor for readers.
  /// @realtime set-up only
  [[nodiscard]] static std::optional<std::pair<BroadcastBell, Descriptor>> make() noexcept;
  /// Maps the bell that a descriptor refers to; nullopt if it is not a bell.
  /// @realtime set-up only
  [[nodiscard]] static std::optional<BroadcastBell> map(int descriptor) noexcept;

  /// Wakes all threads that sleep for any of `bits`, the most urgent first.
  /// @realtime alloc-free, one system call, never blocks
  void ring(std::uint32_t bits) noexcept;
  /// The value to pass to sleep(). Read it before the last check of the condition.
  [[nodiscard]] std::uint32_t value() const noexcept {
    return word().load(std::memory_order_seq_cst);
  }
  /// Sleeps until the bell rings for any of `bits`, or until `until`. Returns at once if the bell
  /// has rung since value() returned `seen`. May wake spuriously.
  /// @realtime alloc-free, one system call
  void sleep(std::uint32_t seen, std::uint32_t bits, MonotonicTime until) noexcept;

 private:
  explicit BroadcastBell(SharedMapping mapping) noexcept : mapping_(std::move(mapping)) {}
  [[nodiscard]] std::atomic<std::uint32_t>& word() const noexcept {
    return *reinterpret_cast<std::atomic<std::uint32_t>*>(mapping_.bytes().data());
  }
  SharedMapping mapping_;
};

/// The writer's side.
/// @ownership the writer's mapping; readers keep theirs
/// @threads  any
/// @realtime set-up only
class BroadcastMemory {
 public:
  /// Creates `size` bytes of zeros, all resident.
  /// @errors   no memory or descriptor left; the kernel lacks F_SEAL_FUTURE_WRITE (before Linux
  ///           5.1)
  [[nodiscard]] static expected<BroadcastMemory, SetupError> make(std::size_t size);

  [[nodiscard]] MutableBytes bytes() const noexcept { return mapping_.bytes(); }
  /// The descriptor for readers, who can only map it for reading.
  [[nodiscard]] int descriptor() const noexcept { return descriptor_.number(); }
  [[nodiscard]] int bell_descriptor() const noexcept { return bell_descriptor_.number(); }
  [[nodiscard]] BroadcastBell& bell() noexcept { return bell_; }

 private:
  BroadcastMemory(Descriptor descriptor, SharedMapping mapping, BroadcastBell bell,
                  Descriptor bell_descriptor) noexcept
      : descriptor_(std::move(descriptor)),
        bell_descriptor_(std::move(bell_descriptor)),
        mapping_(std::move(mapping)),
        bell_(std::move(bell)) {}
  Descriptor descriptor_;
  Descriptor bell_descriptor_;
  SharedMapping mapping_;
  BroadcastBell bell_;
};

/// The socket where readers on this host request the memory `id`: an abstract UNIX socket, visible
/// within the network namespace.
/// @threads  one at a time
/// @realtime set-up only
class BroadcastDoor {
 public:
  /// @errors   the id is in use; no descriptor left
  [[nodiscard]] static expected<BroadcastDoor, SetupError> open(std::uint64_t id);
  /// A descriptor that is readable while a reader is requesting the memory.
  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }
  /// Gives the memory to all waiting readers of the same user, without blocking. Turns away readers
  /// if no descriptor is left.
  void let_in(const BroadcastMemory& memory) noexcept;

 private:
  BroadcastDoor(Descriptor socket, Descriptor spare) noexcept
      : socket_(std::move(socket)), spare_(std::move(spare)) {}
  Descriptor socket_;
  Descriptor spare_;  ///< Closed temporarily when no other descriptor is left.
};

/// A reader's side.
/// @threads  any
/// @realtime set-up only
class BroadcastView {
 public:
  /// Requests the memory `id` on this host.
  /// @errors   no such memory; another user's; no answer by `deadline`; no memory left
  [[nodiscard]] static expected<BroadcastView, SetupError> open(std::uint64_t id,
                                                                MonotonicTime deadline);
  [[nodiscard]] ConstBytes bytes() const noexcept { return mapping_.bytes(); }
  [[nodiscard]] BroadcastBell& bell() noexcept { return bell_; }

 private:
  BroadcastView(SharedMapping mapping, BroadcastBell bell) noexcept
      : mapping_(std::move(mapping)), bell_(std::move(bell)) {}
  SharedMapping mapping_;
  BroadcastBell bell_;
};

}  // namespace rtpm::transport
