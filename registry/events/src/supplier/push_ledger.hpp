#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace rtpm::events {

/// What a supplier knows of the arrival of its events: what it sent, what the hub says to have
/// counted, and what the end of a connection leaves open. A hub counts what it received in its
/// life, so nothing of what it counted is lost; of a connection that ended, the frames that were
/// read are not.
/// @threads  one at a time
/// @realtime alloc-free
class PushLedger {
 public:
  /// One frame with so many events went out to that life of the hub.
  void note_sent(std::uint64_t hub_epoch, std::uint32_t event_count) noexcept;
  /// So many events were not sent.
  void note_failed(std::uint32_t event_count) noexcept { failed_ += event_count; }
  /// Of one frame, sent last, nobody knows whether it arrived.
  void note_doubtful() noexcept { doubtful_ = unconfirmed(); }
  /// The connection ended. Of the frames sent over it, at most the last `frame_count` did not
  /// arrive.
  void note_end(std::uint64_t frame_count) noexcept;
  /// That life of the hub says how many events it has counted.
  void note_counted(std::uint64_t hub_epoch, std::uint64_t event_count) noexcept;

  [[nodiscard]] std::uint64_t sent_count() const noexcept { return sent_before_ + sent_; }
  [[nodiscard]] std::uint64_t failed_count() const noexcept { return failed_; }
  /// Sent, and neither known to have arrived nor maybe lost.
  [[nodiscard]] std::uint64_t unconfirmed_count() const noexcept;
  /// Sent to a hub or over a connection that ended before they were known to have arrived.
  [[nodiscard]] std::uint64_t maybe_lost_count() const noexcept;

 private:
  static constexpr std::size_t kFrameCountMax = 4096;

  [[nodiscard]] std::uint64_t unconfirmed() const noexcept;
  void begin_life(std::uint64_t hub_epoch) noexcept;

  std::uint64_t sent_before_ = 0;  ///< In earlier lives of the hub.
  std::uint64_t lost_before_ = 0;
  std::uint64_t failed_ = 0;
  // In this life of the hub:
  std::uint64_t hub_epoch_ = 0;
  std::uint64_t sent_ = 0;
  std::uint64_t counted_ = 0;       ///< By the hub,
  std::uint64_t counted_base_ = 0;  ///< before it last began anew, having forgotten the supplier.
  std::uint64_t read_ = 0;          ///< Over connections that ended: not among their last frames.
  std::uint64_t doubtful_ = 0;      ///< Unconfirmed when a connection ended last.
  // Over this connection:
  std::uint64_t sent_over_it_ = 0;
  std::uint64_t frame_count_ = 0;
  std::array<std::uint32_t, kFrameCountMax> frames_{};  ///< Events in each of the last frames.
};

}  // namespace rtpm::events
