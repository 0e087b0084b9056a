#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "rtpm/events/event.hpp"
#include "rtpm/events/limits.hpp"

namespace rtpm::events {

class EventRef;

/// Events that several queues, conjunctions and histories hold at a time, each kept once.
/// @ownership all its memory, taken when built; must outlive every EventRef
/// @threads  one at a time, with its references
/// @realtime alloc-free but for construction
class EventStore {
 public:
  explicit EventStore(const StoreConfig& config = {});
  EventStore(const EventStore&) = delete;
  EventStore& operator=(const EventStore&) = delete;

  /// Copies the event; empty if none of its size can be held now, or ever.
  [[nodiscard]] EventRef put(const EventView& event) noexcept;
  /// The largest payload.
  [[nodiscard]] std::uint32_t payload_size_max() const noexcept { return payload_size_max_; }
  /// How many events it holds now.
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

/// Holds one event of a store.
/// @ownership shares the event
/// @threads  as its store
/// @realtime as its store
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
  /// It must not be empty.
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
