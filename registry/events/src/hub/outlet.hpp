#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "exchange/delivery_queue.hpp"
#include "idl.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/events/hub.hpp"

namespace rtpm::events {

/// Encodes stream items, one at a time, in memory allocated at construction.
class ItemBuilder {
 public:
  ItemBuilder();

  /// Contents of an item besides events.
  struct Extras {
    const Welcome* welcome = nullptr;
    const Losses* losses = nullptr;
  };
  /// A part of an event that exceeds an item.
  struct EventPart {
    EventView event{};
    std::size_t offset = 0;
    std::size_t size = 0;
  };
  /// Encodes as many events from the front of the queue as fit `size_max` bytes. Returns their
  /// number.
  [[nodiscard]] std::size_t build(const DeliveryQueue& queue, const Extras& extras,
                                  std::size_t size_max, MonotonicTime now) noexcept;
  void build_part(const EventPart& part, const Extras& extras, MonotonicTime now) noexcept;
  void build_refusal(std::string_view text) noexcept;

  /// The item built last.
  [[nodiscard]] const flatbuffers::FlatBufferBuilder& item() const noexcept { return builder_; }

 private:
  [[nodiscard]] std::uint8_t* begin(std::size_t event_bytes) noexcept;
  void finish(const Extras& extras, const Part* part) noexcept;

  std::vector<std::uint64_t> memory_;
  rpc::LentMemory lent_;
  flatbuffers::FlatBufferBuilder builder_;
  flatbuffers::Offset<flatbuffers::Vector<std::uint8_t>> events_{};
};

/// The hub's end of a subscription: its stream and the state reported to its consumer.
class Outlet {
 public:
  /// Result of pump().
  enum class Outcome : std::uint8_t {
    kDone,     ///< Everything was sent.
    kBacklog,  ///< The consumer accepts no more for now.
    kGone,     ///< The consumer is gone.
  };

  std::uint64_t id = 0;  ///< 0 if there is no subscription.
  std::string name{};
  std::string program{};  ///< As the consumer says, with its process.
  std::uint32_t process = 0;
  rpc::CallerHost host{};
  MonotonicTime begun{};
  Progress progress{};           ///< As the consumer last noted.
  MonotonicTime noted = kNever;  ///< When it did; kNever if it has not.
  rpc::TableWriter<Batch> writer{};
  Welcome welcome{};
  bool is_welcome_due = false;
  bool is_latest_only = false;
  bool is_suspended = false;
  bool is_backlogged = false;
  bool is_dead = false;
  DisconnectReason reason = DisconnectReason::kLeft;  ///< Why the subscription has ended.

  /// Sends from the queue until the consumer accepts no more.
  [[nodiscard]] Outcome pump(DeliveryQueue& queue, Losses& losses, ItemBuilder& builder,
                             MonotonicTime now) noexcept;

 private:
  [[nodiscard]] bool has_room() const noexcept;
  [[nodiscard]] expected<void, rpc::StreamError> send_once(DeliveryQueue& queue, Losses& losses,
                                                           ItemBuilder& builder,
                                                           MonotonicTime now) noexcept;

  Losses reported_{};
  EventRef partial_{};  ///< The large event that is being sent in parts.
  bool is_partial_continued_ = false;
  std::size_t partial_offset_ = 0;  ///< The number of its bytes already sent.
};

}  // namespace rtpm::events
