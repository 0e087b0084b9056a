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
#include "rtpm/transport/socket.hpp"

/// Memory that one process writes and many read. A reader can't write it, not even one that means
/// harm, and the writer never looks at anything that a reader could change. It has no name, so
/// nothing is left of it; readers get it over a UNIX socket.
///
/// Apart from it there is a bell: a word that readers sleep on, and may write. The system finds a
/// word that can't be written the slow way, which took a fifth of all that a reader does for an
/// event. A reader that writes there has others wake for nothing, or sleep on for kBellLookInterval
/// at most.
namespace rtpm::transport {

/// So often a sleeper looks by itself.
inline constexpr Duration kBellLookInterval = std::chrono::milliseconds{100};

/// A mapping of its own of a bell.   Ownership: unmaps at its end.   Threads: any.
class BroadcastBell {
 public:
  /// A new one, and its descriptor, to be handed out.   Set-up only.
  [[nodiscard]] static std::optional<std::pair<BroadcastBell, Descriptor>> make() noexcept;
  /// That of a descriptor; none if it is no bell.   Set-up only.
  [[nodiscard]] static std::optional<BroadcastBell> map(int descriptor) noexcept;
  BroadcastBell(BroadcastBell&& other) noexcept : word_(std::exchange(other.word_, nullptr)) {}
  BroadcastBell& operator=(BroadcastBell&&) = delete;
  ~BroadcastBell();

  /// Wakes all who sleep for one of `bits`, the most urgent first.
  /// RT: alloc-free, one syscall, never blocks.
  void ring(std::uint32_t bits) noexcept;
  /// To be taken before the last look at what one would sleep for.
  [[nodiscard]] std::uint32_t value() const noexcept {
    return word_->load(std::memory_order_seq_cst);
  }
  /// Sleeps until it rings for one of `bits`, if it did not ring at all since value() gave `seen`,
  /// or until `until`; wakes for nothing at times.   RT: alloc-free, one syscall.
  void sleep(std::uint32_t seen, std::uint32_t bits, MonotonicTime until) noexcept;

 private:
  explicit BroadcastBell(std::atomic<std::uint32_t>* word) noexcept : word_(word) {}
  std::atomic<std::uint32_t>* word_;
};

/// The writer's side.
/// Ownership: the memory, in this process; readers keep theirs.   Threads: any.   Set-up only.
class BroadcastMemory {
 public:
  /// `size` bytes of zeros, all of them in memory.
  /// Errors: no memory or descriptor left; a kernel that can't take the right to write away (before
  /// Linux 5.1).
  [[nodiscard]] static expected<BroadcastMemory, SetupError> make(std::size_t size);
  BroadcastMemory(BroadcastMemory&& other) noexcept
      : descriptor_(std::move(other.descriptor_)),
        bell_descriptor_(std::move(other.bell_descriptor_)),
        bytes_(std::exchange(other.bytes_, {})),
        bell_(std::move(other.bell_)) {}
  BroadcastMemory& operator=(BroadcastMemory&&) = delete;
  ~BroadcastMemory();

  [[nodiscard]] MutableBytes bytes() const noexcept { return bytes_; }
  /// To be handed out: it can be mapped for reading only.
  [[nodiscard]] int descriptor() const noexcept { return descriptor_.number(); }
  [[nodiscard]] int bell_descriptor() const noexcept { return bell_descriptor_.number(); }
  [[nodiscard]] BroadcastBell& bell() noexcept { return bell_; }

 private:
  BroadcastMemory(Descriptor descriptor, MutableBytes bytes, BroadcastBell bell,
                  Descriptor bell_descriptor) noexcept
      : descriptor_(std::move(descriptor)),
        bell_descriptor_(std::move(bell_descriptor)),
        bytes_(bytes),
        bell_(std::move(bell)) {}
  Descriptor descriptor_;
  Descriptor bell_descriptor_;
  MutableBytes bytes_;
  BroadcastBell bell_;
};

/// Where readers on this host ask for the memory `id`: an abstract UNIX socket, which reaches as
/// far as the network namespace.   Threads: one at a time.   Set-up only.
class BroadcastDoor {
 public:
  /// Errors: the id is in use; no descriptor left.
  [[nodiscard]] static expected<BroadcastDoor, SetupError> open(std::uint64_t id);
  /// Can be read when somebody asks.
  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }
  /// Gives the memory to all who ask now and are of the same user; never waits for one. Those for
  /// whom there is no descriptor are turned away.
  void let_in(const BroadcastMemory& memory) noexcept;

 private:
  BroadcastDoor(Descriptor socket, Descriptor spare) noexcept
      : socket_(std::move(socket)), spare_(std::move(spare)) {}
  Descriptor socket_;
  Descriptor spare_;  ///< Given up for a moment when no other is left.
};

/// A reader's side.   Ownership: unmaps at its end.   Threads: any.   Set-up only.
class BroadcastView {
 public:
  /// Asks for the memory `id` on this host.
  /// Errors: nobody there; another user's; no answer by the deadline; no memory left.
  [[nodiscard]] static expected<BroadcastView, SetupError> open(std::uint64_t id,
                                                                MonotonicTime deadline);
  BroadcastView(BroadcastView&& other) noexcept
      : bytes_(std::exchange(other.bytes_, {})), bell_(std::move(other.bell_)) {}
  BroadcastView& operator=(BroadcastView&&) = delete;
  ~BroadcastView();
  [[nodiscard]] ConstBytes bytes() const noexcept { return bytes_; }
  [[nodiscard]] BroadcastBell& bell() noexcept { return bell_; }

 private:
  BroadcastView(ConstBytes bytes, BroadcastBell bell) noexcept
      : bytes_(bytes), bell_(std::move(bell)) {}
  ConstBytes bytes_;
  BroadcastBell bell_;
};

}  // namespace rtpm::transport
