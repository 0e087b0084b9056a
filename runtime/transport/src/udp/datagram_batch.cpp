#include "rtpm/transport/datagram_batch.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>

namespace rtpm::transport {

DatagramBatch DatagramBatch::allocate() noexcept {
  DatagramBatch batch;
  batch.buffer_ = rt::LazyMemory(kSizeMax);
  return batch;
}

bool DatagramBatch::add(ConstBytes frame) noexcept {
  const MutableBytes buffer = buffer_.bytes();
  if (frame.empty() || frame.size() > buffer.size() - size_) return false;
  if (!is_empty()) {
    const bool is_over = size_ % frame_size_ != 0 || size_ / frame_size_ == kFrameCountMax;
    if (is_over || frame.size() > frame_size_) return false;
  } else {
    frame_size_ = frame.size();
  }
  std::memcpy(buffer.data() + size_, frame.data(), frame.size());
  size_ += frame.size();
  return true;
}

std::optional<MutableBytes> Datagrams::next() noexcept {
  constexpr std::size_t kAlignment = 16;
  if (is_empty_) return std::nullopt;
  const std::size_t size = std::min(each_, bytes_.size());
  std::byte* frame = bytes_.data();
  bytes_ = bytes_.subspan(size);
  is_empty_ = bytes_.empty();
  const std::size_t kept_size = std::min(size, wire::kDatagramFrameSizeMax + 1);
  // The preceding bytes have already been returned, so they may be overwritten.
  if (const std::size_t excess = reinterpret_cast<std::uintptr_t>(frame) % kAlignment; excess > 0) {
    std::memmove(frame - excess, frame, kept_size);
    frame -= excess;
  }
  return MutableBytes(frame, kept_size);
}

BatchEstimator::Change BatchEstimator::on_datagrams(const wire::PeerAddress& peer, bool is_batch,
                                                    MonotonicTime now) noexcept {
  // Shorter than a reply and its caller's next call take through the kernel.
  constexpr Duration kPause = std::chrono::microseconds{12};
  constexpr std::uint32_t kStreakMin = 3;
  constexpr std::uint32_t kLoneCountMax = 256;
  if (is_on_) {
    lone_count_ = is_batch ? 0 : lone_count_ + 1;
    if (lone_count_ < kLoneCountMax) return Change::kNone;
    is_on_ = false;
    may_be_left_ = true;
    streak_ = 0;
    return Change::kEnd;
  }
  streak_ = peer == last_peer_ && now - last_ < kPause ? streak_ + 1 : 0;
  last_peer_ = peer;
  last_ = now;
  if (streak_ < kStreakMin) return Change::kNone;
  is_on_ = true;
  may_be_left_ = false;
  lone_count_ = 0;
  return Change::kBegin;
}

}  // namespace rtpm::transport
