#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace rtpm::events {

/// Accounts for a supplier's events: sent, counted by the hub, and in doubt when a connection
/// ended. Events that the hub counted, and frames that it read, have arrived.
class PushLedger {
 public:
  /// Notes that a frame of `event_count` events was sent to the hub `epoch`.
  void note_sent(std::uint64_t hub_epoch, std::uint32_t event_count) noexcept;
  /// Notes that `event_count` events were not sent.
  void note_failed(std::uint32_t event_count) noexcept { failed_ += event_count; }
  /// Notes that it is unknown whether the last frame arrived.
  void note_doubtful() noexcept { doubtful_ = unconfirmed(); }
  /// Notes that the connection ended; at most its last `frame_count` frames did not arrive.
  void note_end(std::uint64_t frame_count) noexcept;
  /// Notes the count that the hub `epoch` reports.
  void note_counted(std::uint64_t hub_epoch, std::uint64_t event_count) noexcept;

  [[nodiscard]] std::uint64_t sent_count() const noexcept { return sent_before_ + sent_; }
  [[nodiscard]] std::uint64_t failed_count() const noexcept { return failed_; }
  /// Events sent that are neither confirmed nor possibly lost.
  [[nodiscard]] std::uint64_t unconfirmed_count() const noexcept;
  /// Events sent that were unconfirmed when hub or connection ended.
  [[nodiscard]] std::uint64_t maybe_lost_count() const noexcept;

 private:
  static constexpr std::size_t kFrameCountMax = 4096;

  [[nodiscard]] std::uint64_t unconfirmed() const noexcept;
  void begin_life(std::uint64_t hub_epoch) noexcept;

  std::uint64_t sent_before_ = 0;  ///< Sent to earlier hubs.
  std::uint64_t lost_before_ = 0;
  std::uint64_t failed_ = 0;
  // Counts for the current hub:
  std::uint64_t hub_epoch_ = 0;
  std::uint64_t sent_ = 0;
  std::uint64_t counted_ = 0;       ///< Counted by the hub.
  std::uint64_t counted_base_ = 0;  ///< Counted before the hub last evicted the supplier.
  std::uint64_t read_ = 0;          ///< Read over ended connections, except their last frames.
  std::uint64_t doubtful_ = 0;      ///< Unconfirmed when the last connection ended.
  // Counts over the current connection:
  std::uint64_t sent_over_it_ = 0;
  std::uint64_t frame_count_ = 0;
  std::array<std::uint32_t, kFrameCountMax> frames_{};  ///< Events of each of the last frames.
};

}  // namespace rtpm::events
