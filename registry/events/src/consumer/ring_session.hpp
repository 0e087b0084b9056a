#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "broadcast/reader_source.hpp"
#include "broadcast/ring.hpp"
#include "consumer/broadcast_session.hpp"
#include "rtpm/events/delivery.hpp"
#include "rtpm/transport/broadcast_memory.hpp"

namespace rtpm::events {

/// A hub's ring as a source; the hub wakes its readers.
class RingSource final : public ReaderSource {
 public:
  explicit RingSource(std::shared_ptr<transport::BroadcastView> view) : view_(std::move(view)) {}
  [[nodiscard]] std::uint32_t value() const noexcept override { return view_->bell().value(); }
  void sleep(std::uint32_t seen, std::uint32_t bits, MonotonicTime until) noexcept override {
    view_->bell().sleep(seen, bits, until);
  }
  void ring(std::uint32_t bits) noexcept override { view_->bell().ring(bits); }

 private:
  std::shared_ptr<transport::BroadcastView> view_;
};

/// A consumer's end of a hub's ring.
/// @ownership the mapping, and its own queue
class RingSession final : public BroadcastSession {
 public:
  /// Maps the hub's ring; null if the hub is on another host or belongs to another user.
  [[nodiscard]] static std::unique_ptr<RingSession> open(std::uint64_t id, MonotonicTime deadline);

  [[nodiscard]] std::uint64_t id() const noexcept { return id_; }
  /// Starts reading for a subscription's slot.
  void begin(std::uint32_t slot, std::uint64_t owner, std::uint64_t position,
             const DeliveryPolicy& policy);
  /// The ring as a source for a common reader.
  [[nodiscard]] std::shared_ptr<ReaderSource> source() const {
    return std::make_shared<RingSource>(view_);
  }

  void set_policy(const DeliveryPolicy& policy) override;
  [[nodiscard]] Outcome take(const Taker& taker, Asking asking) override;
  void wait(rt::WaitStrategy strategy, MonotonicTime until) noexcept override;
  [[nodiscard]] bool has_more() const noexcept override { return reader_->has_more(); }
  [[nodiscard]] std::uint32_t wake_bits() const noexcept override { return reader_->wake_bits(); }
  [[nodiscard]] Losses losses() const noexcept override;

 private:
  RingSession(std::shared_ptr<transport::BroadcastView> view, std::uint64_t id)
      : view_(std::move(view)), id_(id) {}

  [[nodiscard]] std::uint64_t backlog() const noexcept {
    const std::uint64_t known = reader_->read_count() + reader_->missed_count();
    const std::uint64_t written = reader_->written_count();
    return written > known ? written - known : 0;
  }
  /// Whether events bypass the queue.
  [[nodiscard]] bool is_direct() const noexcept {
    return queue_.empty() && (is_queue_ring_ || backlog() <= direct_max_);
  }
  /// Decodes the record into group_; false if malformed.
  [[nodiscard]] bool parse() noexcept;
  [[nodiscard]] std::optional<Outcome> fill_queue();

  std::shared_ptr<transport::BroadcastView> view_;
  std::uint64_t id_;
  std::optional<RingReader> reader_{};
  std::uint64_t direct_max_ = 0;  ///< The largest backlog with which events bypass the queue.
  bool is_queue_ring_ = false;    ///< They always do: half of the ring is the queue.
  LocalQueue queue_{};
  std::vector<EventView> group_{};
};

}  // namespace rtpm::events
