#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "model/source.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/connection.hpp"
#include "rtpm/wire/cookie.hpp"

namespace rtpm::rpc {

/// A connection of a lane, or an empty slot.
struct Slot {
  std::unique_ptr<transport::Connection> stream;  ///< Null if free.
  /// `port` holds the slot's index in its low bits, for direct look-up, and the generation above.
  wire::PeerAddress peer{};
  MonotonicTime heard{};                ///< When its last frame, or the connection itself, arrived.
  std::uint32_t generation = 0;         ///< Counts the connections that have used this slot.
  std::optional<std::uint32_t> user{};  ///< The kernel's user id of a shared-memory caller.
  bool is_memory = false;
  bool is_from_this_host = false;
  bool has_leftovers = false;  ///< It is in the list of leftovers.
};

/// The connections of a lane; each is in the wait set while it is here. Has a fixed capacity.
/// @threads  one at a time, with the lane's Lead
/// @realtime alloc-free except construction
class Connections {
 public:
  /// Two for each of 65 535 sessions.
  static constexpr std::uint32_t kIndexBits = 17;
  static constexpr std::uint32_t kIndexMask = (1U << kIndexBits) - 1;

  Connections(std::size_t count_max, transport::WaitSet& wait_set);

  [[nodiscard]] std::size_t count() const noexcept { return streams_.size() + memory_.size(); }
  [[nodiscard]] std::size_t count_max() const noexcept { return slots_.size(); }
  [[nodiscard]] std::span<Slot* const> of_medium(bool is_memory) const noexcept {
    return is_memory ? memory_ : streams_;
  }
  /// The connection with this tag; null once it has ended.
  [[nodiscard]] Slot* find(SourceTag tag) noexcept;
  [[nodiscard]] Slot* of_peer(const wire::PeerAddress& peer) noexcept;
  [[nodiscard]] SourceTag tag_of(const Slot& slot) const noexcept {
    return tag_of(slot, kConnectionKind);
  }
  /// Whether polling the source costs no system call.
  [[nodiscard]] bool is_memory(SourceTag tag) noexcept {
    const Slot* const slot = find(tag);
    return tag == kGateSource || (slot != nullptr && slot->is_memory);
  }

  /// False if the system refuses; then the caller keeps the connection. Requires a free slot.
  [[nodiscard]] bool add(std::unique_ptr<transport::Connection>& stream,
                         MonotonicTime now) noexcept;
  [[nodiscard]] std::unique_ptr<transport::Connection> remove(Slot& slot) noexcept;
  /// Ends all connections; returns their number.
  std::size_t clear() noexcept;

  /// Notes that a frame is left in its buffer, which would wake no wait.
  void note_leftovers(Slot& slot) noexcept {
    if (slot.has_leftovers) return;
    slot.has_leftovers = true;
    leftovers_.push_back(&slot);
  }
  [[nodiscard]] bool has_leftovers() const noexcept { return !leftovers_.empty(); }
  /// All noted connections; they may be noted again. Valid until the next call.
  [[nodiscard]] std::span<Slot* const> take_leftovers() noexcept;

  /// The next shared-memory connection with a frame, among the next `left` ones; decrements `left`.
  /// Null if none has one.
  [[nodiscard]] Slot* next_with_frame(std::size_t& left) noexcept;

  /// Makes shared-memory peers ring when they call; false if one has already called.
  [[nodiscard]] bool announce_sleep() noexcept;
  void end_sleep() noexcept;

 private:
  [[nodiscard]] SourceTag tag_of(const Slot& slot, SourceKind kind) const noexcept {
    return SourceTag(kind, static_cast<std::uint32_t>(&slot - slots_.data()), slot.generation);
  }
  [[nodiscard]] bool watch(const Slot& slot) noexcept;

  transport::WaitSet& wait_set_;
  std::vector<Slot> slots_;
  std::vector<Slot*> free_;
  std::vector<Slot*> memory_;
  std::vector<Slot*> streams_;
  std::vector<Slot*> leftovers_;
  std::vector<Slot*> taken_leftovers_;
  std::size_t next_memory_ = 0;  ///< Where in memory_ next_with_frame() continues, downwards.
};

}  // namespace rtpm::rpc
