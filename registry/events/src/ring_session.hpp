#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "local_queue.hpp"
#include "rtpm/events/delivery.hpp"
#include "rtpm/events/ring.hpp"
#include "rtpm/rt/wait.hpp"
#include "rtpm/transport/broadcast_memory.hpp"

namespace rtpm::events {

/// A consumer's end of a hub's ring: reads what is for it, and does by itself what the hub would do
/// for one that has a stream: drops what the policy says when the handler does not keep up.
/// Ownership: the mapping, and a queue of its own.   Threads: one.
class RingSession {
 public:
  /// Maps the hub's ring; null if that can't be: the hub is on another host, or another user's.
  [[nodiscard]] static std::unique_ptr<RingSession> open(std::uint64_t id, MonotonicTime deadline);

  [[nodiscard]] std::uint64_t id() const noexcept { return id_; }
  [[nodiscard]] bool has_more() const noexcept { return reader_->has_more(); }
  /// Begins to read for a place.
  void begin(std::uint32_t place, std::uint64_t owner, std::uint64_t position,
             const DeliveryPolicy& policy);
  /// Another policy; what waits stays as far as there is room.
  void set_policy(const DeliveryPolicy& policy);

  using Outcome = SessionOutcome;
  /// Takes one delivery and calls deliver(span of EventView) with it.
  template <class Deliver>
  [[nodiscard]] Outcome take(Deliver deliver) {
    if (queue_.empty() && backlog() <= direct_max_) {
      const RingRead read = reader_->read();
      if (read == RingRead::kEvents) return take_record(deliver);
      if (read == RingRead::kGone) return Outcome::kGone;
      return read == RingRead::kBroken ? Outcome::kBroken : Outcome::kNothing;
    }
    if (const auto failed = fill_queue()) return *failed;
    return queue_.take(deliver) ? Outcome::kDelivered : Outcome::kNothing;
  }
  /// What it reads, and which bits of the bell it is woken by.
  [[nodiscard]] const std::shared_ptr<transport::BroadcastView>& view() const noexcept {
    return view_;
  }
  [[nodiscard]] std::uint32_t wake_bits() const noexcept { return reader_->wake_bits(); }
  /// Waits until more is written, or until `until`.
  void wait(rt::WaitStrategy strategy, MonotonicTime until) noexcept;

  /// What was lost since begin(), on this side.
  [[nodiscard]] Losses losses() const noexcept;

 private:
  RingSession(std::shared_ptr<transport::BroadcastView> view, std::uint64_t id)
      : view_(std::move(view)), id_(id) {}

  [[nodiscard]] std::uint64_t backlog() const noexcept {
    const std::uint64_t known = reader_->read_count() + reader_->missed_count();
    const std::uint64_t written = reader_->written_count();
    return written > known ? written - known : 0;
  }
  /// The events of the record that was read, into group_; false if they are none.
  [[nodiscard]] bool parse() noexcept;
  template <class Deliver>
  [[nodiscard]] Outcome take_record(Deliver deliver) {
    if (!parse()) return Outcome::kBroken;
    deliver(std::span<const EventView>(group_));
    return Outcome::kDelivered;
  }
  [[nodiscard]] std::optional<Outcome> fill_queue();

  std::shared_ptr<transport::BroadcastView> view_;
  std::uint64_t id_;
  std::optional<RingReader> reader_{};
  std::uint64_t direct_max_ = 0;  ///< Events that may be waiting without a need for the queue.
  LocalQueue queue_{};
  std::vector<EventView> group_{};
};

}  // namespace rtpm::events
