#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/lazy_memory.hpp"
#include "rtpm/wire/cookie.hpp"
#include "rtpm/wire/limits.hpp"

// Several datagrams that cross the system's network stack as one, and are datagrams on the wire and
// for whoever takes them one by one. Source: UDP_SEGMENT and UDP_GRO, udp(7). Between two programs
// of a host that is most of what a datagram costs.
namespace rtpm::transport {

/// Frames on their way to one peer, one behind the other: all as large as the first but the last,
/// which may be smaller.
/// Threads: one at a time.   RT: alloc-free but for construction.
class DatagramBatch {
 public:
  static constexpr std::size_t kFrameCountMax = wire::kFragmentWindow;
  static constexpr std::size_t kSizeMax = kFrameCountMax * wire::kDatagramFrameSizeMax;

  /// Has no room for any.
  DatagramBatch() noexcept = default;
  /// One with room, unless the system has none left.   Set-up only.
  [[nodiscard]] static DatagramBatch with_room() noexcept;

  /// Copies `frame` behind the others. False: it does not fit behind these, or, if the batch is
  /// empty, into any.
  [[nodiscard]] bool add(ConstBytes frame) noexcept;
  void clear() noexcept { size_ = frame_size_ = 0; }

  [[nodiscard]] bool has_room() const noexcept { return !room_.bytes().empty(); }
  [[nodiscard]] bool is_empty() const noexcept { return size_ == 0; }
  [[nodiscard]] ConstBytes bytes() const noexcept { return room_.bytes().first(size_); }
  /// Of all but the last.
  [[nodiscard]] std::size_t frame_size() const noexcept { return frame_size_; }
  /// Visits each frame for as long as that gives true; gives back whether all were.
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
  rt::LazyMemory room_;
  std::size_t size_ = 0;
  std::size_t frame_size_ = 0;
};

/// Datagrams that came together from one peer: all of one size but the last, which may be smaller.
/// Ownership: refers to the buffer into which they were received.   RT: alloc-free.
class Datagrams {
 public:
  /// As many bytes as come together at most.
  static constexpr std::size_t kSizeMax = std::size_t{64} * 1024;

  Datagrams() noexcept = default;
  Datagrams(MutableBytes bytes, std::size_t each, const wire::PeerAddress& peer) noexcept
      : bytes_(bytes), each_(each), peer_(peer), is_empty_(false) {}

  /// The next one, if there is one more. It is aligned to 16 bytes if the buffer is, and valid
  /// until the following next(). One that is longer than a frame is cut to one byte more than that,
  /// so that it is noticed.
  [[nodiscard]] std::optional<ConstBytes> next() noexcept;
  [[nodiscard]] bool is_empty() const noexcept { return is_empty_; }
  /// What next() has not given yet.
  [[nodiscard]] ConstBytes bytes() const noexcept { return bytes_; }
  [[nodiscard]] bool are_several() const noexcept { return bytes_.size() > each_; }
  [[nodiscard]] const wire::PeerAddress& peer() const noexcept { return peer_; }

 private:
  MutableBytes bytes_{};
  std::size_t each_ = 0;
  wire::PeerAddress peer_{};
  bool is_empty_ = true;  ///< One of no bytes is a datagram, too.
};

/// When a port is to take batches: it makes each receive longer, by as much as shows where every
/// caller waits for its reply before it calls again. That one leaves a pause behind its datagram.
/// Threads: one at a time.   RT: alloc-free, a few ns.
class BatchEstimator {
 public:
  enum class Change : std::uint8_t { kNone, kBegin, kEnd };

  [[nodiscard]] bool is_on() const noexcept { return is_on_; }
  /// Batches were ended when some may have been on their way to whoever receives next.
  [[nodiscard]] bool may_be_left() const noexcept { return may_be_left_; }

  /// There was nothing to receive.
  void on_nothing() noexcept {
    streak_ = 0;
    may_be_left_ = false;
  }
  /// Something of this peer was received: a batch, or one datagram.
  [[nodiscard]] Change on_datagrams(const wire::PeerAddress& peer, bool is_batch,
                                    MonotonicTime now) noexcept;

 private:
  bool is_on_ = false;
  bool may_be_left_ = false;
  wire::PeerAddress last_peer_{};
  MonotonicTime last_{};
  std::uint32_t streak_ = 0;      ///< Datagrams of one peer that came without a pause,
  std::uint32_t lone_count_ = 0;  ///< and those since the last batch.
};

}  // namespace rtpm::transport
