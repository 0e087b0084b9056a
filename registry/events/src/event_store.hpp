#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "rtpm/events/event.hpp"
#include "rtpm/events/limits.hpp"

namespace rtpm::events {

class EventRef;

/// Stores each event once for all queues, conjunctions and histories that refer to it.
/// @ownership its memory, allocated at construction; must outlive every EventRef
/// @threads  one at a time, including its references
/// @realtime alloc-free except construction
class EventStore {
 public:
  explicit EventStore(const StoreConfig& config = {});
  EventStore(const EventStore&) = delete;
  EventStore& operator=(const EventStore&) = delete;

  /// Copies the event; returns an empty reference if there is no free slot of its size.
  [[nodiscard]] EventRef put(const EventView& event) noexcept;
  /// The largest payload.
  [[nodiscard]] std::uint32_t payload_size_max() const noexcept { return payload_size_max_; }
  /// The number of stored events.
  [[nodiscard]] std::size_t count() const noexcept { return held_count_; }

 private:
  friend class EventRef;
  struct alignas(64) Line {
    std::byte bytes[64];
  };
  struct Slot {
    EventHeader header{};
    std::byte* memory = nullptr;
    std::uint32_t payload_size = 0;
    std::uint32_t reference_count = 0;
    std::uint32_t next_free = 0;
    std::uint16_t size_class = 0;
  };
  struct Class {
    std::uint32_t payload_size_max = 0;
    std::uint32_t first_free = 0;
  };
  static constexpr std::uint32_t kNone = 0xffff'ffff;

  void release(Slot& slot) noexcept;

  std::vector<Line> lines_;
  std::vector<Slot> slots_;
  std::vector<Class> classes_;
  std::uint32_t payload_size_max_ = 0;
  std::size_t held_count_ = 0;
};

/// A reference to an event of a store.
/// @ownership shared: reference-counted
/// @threads  like its store
/// @realtime like its store
class EventRef {
 public:
  EventRef() noexcept = default;
  EventRef(const EventRef& other) noexcept : store_(other.store_), slot_(other.slot_) {
    if (slot_ != nullptr) ++slot_->reference_count;
  }
  EventRef(EventRef&& other) noexcept
      : store_(std::exchange(other.store_, nullptr)), slot_(std::exchange(other.slot_, nullptr)) {}
  EventRef& operator=(EventRef other) noexcept {
    std::swap(store_, other.store_);
    std::swap(slot_, other.slot_);
    return *this;
  }
  ~EventRef() {
    if (slot_ != nullptr) store_->release(*slot_);
  }

  [[nodiscard]] explicit operator bool() const noexcept { return slot_ != nullptr; }
  /// Requires a non-empty reference, like payload() and view().
  [[nodiscard]] const EventHeader& header() const noexcept { return slot_->header; }
  [[nodiscard]] ConstBytes payload() const noexcept { return {slot_->memory, slot_->payload_size}; }
  [[nodiscard]] EventView view() const noexcept { return {header(), payload()}; }
  friend bool operator==(const EventRef& a, const EventRef& b) noexcept {
    return a.slot_ == b.slot_;
  }

 private:
  friend class EventStore;
  EventRef(EventStore& store, EventStore::Slot& slot) noexcept : store_(&store), slot_(&slot) {}
  EventStore* store_ = nullptr;
  EventStore::Slot* slot_ = nullptr;
};

}  // namespace rtpm::events
