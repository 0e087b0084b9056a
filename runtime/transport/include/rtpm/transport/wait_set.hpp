#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::transport {

class UdpPort;

/// The kind of a source, defined by the wait set's owner, from 1 to 15.
enum class SourceKind : std::uint8_t { kDoorbell = 0 };

/// Identifies a source in the result of a wait. The generation distinguishes a slot's current
/// source from earlier ones: compare whole tags before using the slot.
class SourceTag {
 public:
  /// Higher bits of a generation are ignored.
  static constexpr std::uint32_t kGenerationMax = (std::uint32_t{1} << 28) - 1;

  /// The tag of the doorbell.
  constexpr SourceTag() noexcept = default;
  constexpr explicit SourceTag(SourceKind kind, std::uint32_t index = 0,
                               std::uint32_t generation = 0) noexcept
      : raw_(static_cast<std::uint64_t>(kind) << 60 |
             std::uint64_t{generation & kGenerationMax} << 32 | index) {}
  [[nodiscard]] static constexpr SourceTag from_raw(std::uint64_t raw) noexcept {
    SourceTag tag;
    tag.raw_ = raw;
    return tag;
  }

  [[nodiscard]] constexpr SourceKind kind() const noexcept {
    return static_cast<SourceKind>(raw_ >> 60);
  }
  [[nodiscard]] constexpr std::uint32_t generation() const noexcept {
    return static_cast<std::uint32_t>(raw_ >> 32) & kGenerationMax;
  }
  [[nodiscard]] constexpr std::uint32_t index() const noexcept {
    return static_cast<std::uint32_t>(raw_);
  }
  [[nodiscard]] constexpr std::uint64_t raw() const noexcept { return raw_; }
  friend constexpr bool operator==(SourceTag, SourceTag) noexcept = default;

 private:
  std::uint64_t raw_ = 0;
};

inline constexpr SourceTag kDoorbell{};

/// When a source is reported.
enum class Trigger : std::uint8_t {
  kLevel,  ///< Reported in each wait while the source is readable.
  /// Reported once per signal: for an event that is never read, which saves a system call each
  /// time. Only for Connection::event().
  kEdge,
};

/// A deadline in the past: do not block.
inline constexpr MonotonicTime kAlready = MonotonicTime::min();

/// A lock that a wait releases while it may block.
class WaitLock {
 public:
  virtual void lock() noexcept = 0;
  virtual void unlock() noexcept = 0;

 protected:
  ~WaitLock() = default;
};

/// Everything that a thread waits for: descriptors, and a doorbell that other threads ring.
/// @threads  ring(): any; the rest: one at a time, under a shared lock if several threads use the
///           set; see wait()
class WaitSet {
 public:
  WaitSet() = default;
  WaitSet(const WaitSet&) = delete;
  WaitSet& operator=(const WaitSet&) = delete;
  virtual ~WaitSet() = default;

  /// @param source_count_max  its capacity, not counting the doorbell
  /// @realtime set-up only
  /// @errors   no descriptor left; the system is too old
  [[nodiscard]] static expected<std::unique_ptr<WaitSet>, SetupError> open(
      std::size_t source_count_max);
  /// Opens the set of a lane. While the lane's UDP port is its only source, it may receive from the
  /// port instead of polling it. Such a wait may end up to kBlockTime before its time.
  /// @realtime set-up only
  /// @errors   as open()
  [[nodiscard]] static expected<std::unique_ptr<WaitSet>, SetupError> open_for_lane(
      std::size_t source_count_max);

  /// Reports `descriptor` as `tag` from now on, even in a wait that is in progress with a lock.
  /// @param descriptor  must stay open until remove()
  /// @param tag         of any kind except kDoorbell
  /// @return false if the set is full or already has the descriptor, or the system refuses
  [[nodiscard]] virtual bool add(int descriptor, SourceTag tag, Trigger trigger) noexcept = 0;
  /// Adds a port as a level-triggered source. The set may receive from it instead of polling it.
  /// @param port    must not move until remove() of its descriptor
  /// @param buffer  for datagrams received while waiting, Datagrams::kSizeMax bytes; see
  ///           UdpPort::await()
  /// @return as add()
  [[nodiscard]] virtual bool add_port(UdpPort& port, MutableBytes buffer, SourceTag tag) noexcept;
  /// Removes a descriptor. Later waits do not report it or hold a reference to it; a wait in
  /// progress may still report its tag.
  virtual void remove(int descriptor) noexcept = 0;
  /// Blocks until a source is ready, the doorbell has rung, or `until`.
  /// @param until  kNever for no limit; kAlready to return at once
  /// @param ready  receives the tags; if there are more, the next waits report them, in turn
  /// @param held   null, or the caller's lock, which is released while the wait may block
  /// @return the number of tags; may be 0 if the wait ended early, for example by a signal
  [[nodiscard]] virtual std::size_t wait(MonotonicTime until, std::span<SourceTag> ready,
                                         WaitLock* held = nullptr) noexcept = 0;
  /// Ends the wait in progress, or the next one, which reports kDoorbell once, however often it
  /// rang. The caller's earlier writes are visible after that wait.
  /// @realtime at most one system call
  virtual void ring() noexcept = 0;
};

}  // namespace rtpm::transport
