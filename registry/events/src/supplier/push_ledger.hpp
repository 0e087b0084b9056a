#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace rtpm::events {

/// Accounts for a supplier's events: sent, counted by the hub, and in doubt at the end of a
/// connection. Events that the hub counted and frames that it read have arrived.
class PushLedger {
 public:
  /// A frame of `event_count` events was sent to the hub `epoch`.
  void note_sent(std::uint64_t hub_epoch, std::uint32_t event_count) noexcept;
  /// `event_count` events were not sent.
  void note_failed(std::uint32_t event_count) noexcept { failed_ += event_count; }
  /// Whether the last frame arrived is unknown.
  void note_doubtful() noexcept { doubtful_ = unconfirmed(); }
  /// The connection ended; at most its last `frame_count` frames did not arrive.
  void note_end(std::uint64_t frame_count) noexcept;
  /// The hub `epoch` reports its count.
  void note_counted(std::uint64_t hub_epoch, std::uint64_t event_count) noexcept;

  [[nodiscard]] std::uint64_t sent_count() const noexcept { return sent_before_ + sent_; }
  [[nodiscard]] std::uint64_t failed_count() const noexcept { return failed_; }
  /// Events sent, neither confirmed nor possibly lost.
  [[nodiscard]] std::uint64_t unconfirmed_count() const noexcept;
  /// Events sent, unconfirmed when hub or connection ended.
  [[nodiscard]] std::uint64_t maybe_lost_count() const noexcept;

 private:
  static constexpr std::size_t kFrameCountMax = 4096;

  [[nodiscard]] std::uint64_t unconfirmed() const noexcept;
  void begin_life(std::uint64_t hub_epoch) noexcept;

  std::uint64_t sent_before_ = 0;  ///< Sent to earlier hubs.
  std::uint64_t lost_before_ = 0;
  std::uint64_t failed_ = 0;
  // Counts for the present hub:
  std::uint64_t hub_epoch_ = 0;
  std::uint64_t sent_ = 0;
  std::uint64_t counted_ = 0;       ///< Counted by the hub.
  std::uint64_t counted_base_ = 0;  ///< Counted before the hub last evicted the supplier.
  std::uint64_t read_ = 0;          ///< Read over ended connections, before their last frames.
  std::uint64_t doubtful_ = 0;      ///< Unconfirmed when the last connection ended.
  // Counts over the present connection:
  std::uint64_t sent_over_it_ = 0;
  std::uint64_t frame_count_ = 0;
  std::array<std::uint32_t, kFrameCountMax> frames_{};  ///< Events of each of the last frames.
};

}  // namespace rtpm::events
