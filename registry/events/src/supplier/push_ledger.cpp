#include "supplier/push_ledger.hpp"

#include <algorithm>

namespace rtpm::events {

// Confirmed: the larger of counted and read.
std::uint64_t PushLedger::unconfirmed() const noexcept {
  return sent_ - std::min(sent_, std::max(counted_, read_));
}

std::uint64_t PushLedger::maybe_lost_count() const noexcept {
  return lost_before_ + std::min(doubtful_, unconfirmed());
}

std::uint64_t PushLedger::unconfirmed_count() const noexcept {
  const std::uint64_t count = unconfirmed();
  return count - std::min(doubtful_, count);
}

void PushLedger::begin_life(std::uint64_t hub_epoch) noexcept {
  sent_before_ += sent_;
  lost_before_ += unconfirmed();
  hub_epoch_ = hub_epoch;
  sent_ = counted_ = counted_base_ = read_ = doubtful_ = 0;
  sent_over_it_ = frame_count_ = 0;
}

void PushLedger::note_sent(std::uint64_t hub_epoch, std::uint32_t event_count) noexcept {
  if (hub_epoch != hub_epoch_) begin_life(hub_epoch);
  sent_ += event_count;
  sent_over_it_ += event_count;
  frames_[frame_count_++ % kFrameCountMax] = event_count;
}

void PushLedger::note_end(std::uint64_t frame_count) noexcept {
  std::uint64_t open = 0;
  if (frame_count >= std::min<std::uint64_t>(frame_count_, kFrameCountMax)) {
    open = sent_over_it_;
  } else {
    for (std::uint64_t i = 1; i <= frame_count; ++i)
      open += frames_[(frame_count_ - i) % kFrameCountMax];
  }
  read_ += sent_over_it_ - open;
  sent_over_it_ = frame_count_ = 0;
  doubtful_ = unconfirmed();
}

void PushLedger::note_counted(std::uint64_t hub_epoch, std::uint64_t event_count) noexcept {
  // The count is from an earlier hub, or from one to which nothing was sent yet.
  if (hub_epoch != hub_epoch_) return;
  if (counted_base_ + event_count < counted_) counted_base_ = counted_;
  counted_ = counted_base_ + event_count;
}

}  // namespace rtpm::events
