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
/// and the writer never loads a value that a reader could change. It has no name, so nothing of it
/// remains. Readers get it over a UNIX socket.
///
/// The bell is a separate word that readers sleep on and may write: the kernel's futex is slow for
/// a word that cannot be written, by a fifth of a reader's cost per event. A malicious reader can
/// wake others spuriously, or let them sleep for kBellLookInterval at most.
namespace rtpm::transport {

/// The longest sleep on a bell, after which a reader checks the memory unprompted.
inline constexpr Duration kBellLookInterval = std::chrono::milliseconds{100};

/// This process's mapping of a bell.
/// @threads  any
class BroadcastBell {
 public:
  /// A new bell and its descriptor, for readers.
  /// @realtime set-up only
  [[nodiscard]] static std::optional<std::pair<BroadcastBell, Descriptor>> make() noexcept;
  /// Maps the bell of a descriptor; nothing if it is not a bell.
  /// @realtime set-up only
  [[nodiscard]] static std::optional<BroadcastBell> map(int descriptor) noexcept;

  /// Wakes all threads that sleep for one of `bits`, the most urgent first.
  /// @realtime alloc-free, one system call, never blocks
  void ring(std::uint32_t bits) noexcept;
  /// The value for sleep(): take it before the last check of the condition to sleep for.
  [[nodiscard]] std::uint32_t value() const noexcept {
    return word().load(std::memory_order_seq_cst);
  }
  /// Sleeps until the bell rings for one of `bits`, or until `until`. Returns at once if the bell
  /// rang since value() gave `seen`. May wake spuriously.
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
/// @ownership the memory, in this process; readers keep theirs
/// @threads  any
/// @realtime set-up only
class BroadcastMemory {
 public:
  /// `size` bytes of zeros, all resident.
  /// @errors   no memory or descriptor left; the kernel lacks F_SEAL_FUTURE_WRITE (before Linux
  ///           5.1)
  [[nodiscard]] static expected<BroadcastMemory, SetupError> make(std::size_t size);

  [[nodiscard]] MutableBytes bytes() const noexcept { return mapping_.bytes(); }
  /// The descriptor for readers, which they can map for reading only.
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

/// The socket at which readers on this host ask for the memory `id`: an abstract UNIX socket, which
/// is visible within the network namespace.
/// @threads  one at a time
/// @realtime set-up only
class BroadcastDoor {
 public:
  /// @errors   the id is in use; no descriptor left
  [[nodiscard]] static expected<BroadcastDoor, SetupError> open(std::uint64_t id);
  /// Readable while a reader asks.
  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }
  /// Gives the memory to all readers of the same user that ask now, without waiting for one. Turns
  /// away readers for which no descriptor is left.
  void let_in(const BroadcastMemory& memory) noexcept;

 private:
  BroadcastDoor(Descriptor socket, Descriptor spare) noexcept
      : socket_(std::move(socket)), spare_(std::move(spare)) {}
  Descriptor socket_;
  Descriptor spare_;  ///< Closed for a moment when no other descriptor is left.
};

/// A reader's side.
/// @threads  any
/// @realtime set-up only
class BroadcastView {
 public:
  /// Asks for the memory `id` on this host.
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
