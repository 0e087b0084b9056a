#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/lazy_memory.hpp"
#include "rtpm/wire/cookie.hpp"
#include "rtpm/wire/limits.hpp"

// Several datagrams that cross the kernel's network stack as one; the crossing is most of a
// datagram's cost between two programs on one host. On the wire, and for a receiver without GRO,
// they are separate. Source: UDP_SEGMENT and UDP_GRO, udp(7).
namespace rtpm::transport {

/// Consecutive frames to one peer. All have the size of the first, except the last, which may be
/// smaller.
/// @threads  one at a time
/// @realtime alloc-free except allocate()
class DatagramBatch {
 public:
  static constexpr std::size_t kFrameCountMax = wire::kFragmentWindow;
  static constexpr std::size_t kSizeMax = kFrameCountMax * wire::kDatagramFrameSizeMax;

  DatagramBatch() noexcept = default;
  /// Creates a batch with a buffer, unless the system has no memory left. A default batch accepts
  /// no frame.
  [[nodiscard]] static DatagramBatch allocate() noexcept;

  /// Appends a copy of `frame`.
  /// @return false if it does not fit after the earlier frames, or fits no batch at all
  [[nodiscard]] bool add(ConstBytes frame) noexcept;
  void clear() noexcept { size_ = frame_size_ = 0; }

  [[nodiscard]] bool is_allocated() const noexcept { return !buffer_.bytes().empty(); }
  [[nodiscard]] bool is_empty() const noexcept { return size_ == 0; }
  [[nodiscard]] ConstBytes bytes() const noexcept { return buffer_.bytes().first(size_); }
  /// The size of all frames except the last.
  [[nodiscard]] std::size_t frame_size() const noexcept { return frame_size_; }
  /// Calls `visit` for each frame until it returns false.
  /// @return whether all frames were visited
  template <class Visitor>
  [[nodiscard]] bool for_each(Visitor visit) const noexcept {
    for (ConstBytes rest = bytes(); !rest.empty();) {
      const std::size_t size = rest.size() < frame_size_ ? rest.size() : frame_size_;
      if (!visit(rest.first(size))) return false;
      rest = rest.subspan(size);
    }
    return true;
  }

 private:
  rt::LazyMemory buffer_;
  std::size_t size_ = 0;
  std::size_t frame_size_ = 0;
};

/// Datagrams received together from one peer. All have the same size, except the last, which may be
/// smaller.
/// @ownership views the receive buffer
/// @realtime alloc-free
class Datagrams {
 public:
  static constexpr std::size_t kSizeMax = std::size_t{64} * 1024;

  Datagrams() noexcept = default;
  Datagrams(MutableBytes bytes, std::size_t each, const wire::PeerAddress& peer) noexcept
      : bytes_(bytes), each_(each), peer_(peer), is_empty_(false) {}

  /// Returns the next datagram, if any; valid until the following next(), aligned to 16 bytes if
  /// the buffer is. A datagram larger than a frame is truncated to a frame's size plus one byte, so
  /// that the caller notices.
  [[nodiscard]] std::optional<MutableBytes> next() noexcept;
  [[nodiscard]] bool is_empty() const noexcept { return is_empty_; }
  /// The bytes that next() has not returned yet.
  [[nodiscard]] ConstBytes bytes() const noexcept { return bytes_; }
  [[nodiscard]] bool are_several() const noexcept { return bytes_.size() > each_; }
  [[nodiscard]] const wire::PeerAddress& peer() const noexcept { return peer_; }

 private:
  MutableBytes bytes_{};
  std::size_t each_ = 0;
  wire::PeerAddress peer_{};
  bool is_empty_ = true;  ///< Not the same as bytes_.empty(): a datagram may have no bytes.
};

/// Decides when a port should receive batches. They slow down each receive, so they do not pay if
/// every caller waits for its reply before its next call; such a caller pauses after each datagram.
/// @threads  one at a time
/// @realtime alloc-free, a few ns
class BatchEstimator {
 public:
  enum class Change : std::uint8_t { kNone, kBegin, kEnd };

  [[nodiscard]] bool is_on() const noexcept { return is_on_; }
  /// Whether a batch may still be received, although batches were switched off.
  [[nodiscard]] bool may_be_left() const noexcept { return may_be_left_; }

  /// Call it when nothing was received.
  void on_nothing() noexcept {
    streak_ = 0;
    may_be_left_ = false;
  }
  /// Call it when a batch, or one datagram, was received.
  [[nodiscard]] Change on_datagrams(const wire::PeerAddress& peer, bool is_batch,
                                    MonotonicTime now) noexcept;

 private:
  bool is_on_ = false;
  bool may_be_left_ = false;
  wire::PeerAddress last_peer_{};
  MonotonicTime last_{};
  std::uint32_t streak_ = 0;      ///< Consecutive datagrams of one peer without a pause.
  std::uint32_t lone_count_ = 0;  ///< Single datagrams since the last batch.
};

}  // namespace rtpm::transport
