#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/large_messages.hpp"
#include "rtpm/wire/medium.hpp"
#include "rtpm/wire/stream.hpp"

namespace rtpm::wire {

/// A stream's share of ServerSessionsConfig::stream_memory: over datagrams all unacknowledged
/// frames, otherwise one frame. The caller of push_item() keeps the items themselves.
[[nodiscard]] constexpr std::size_t stream_buffer_size(Medium medium) noexcept {
  return medium == Medium::kDatagram ? kStreamWindow * kDatagramFrameSizeMax : kStreamFrameSizeMax;
}

/// The streams of items with which a lane's sessions answer calls.
/// @threads  one
/// @realtime alloc-free except construction; begin() and visit_expired() are linear in the streams
/// @source   spec/hprotocol.md#hp-5.10
class ServerStreams {
 public:
  static constexpr std::uint16_t kNone = 0xffff;  ///< The index that means no stream.

  /// @param memory  owned by the caller; stream_buffer_size() bytes per stream
  ServerStreams(MutableBytes memory, Medium medium);

  [[nodiscard]] std::uint32_t open_count() const noexcept { return open_count_; }
  /// Starts the stream that the call `header` requests.
  /// @param deadline  when its lease ends, unless its caller is heard
  /// @return its index; kNone if all are in use
  [[nodiscard]] std::uint16_t begin(const Header& header, const CallPlace& call,
                                    std::uint32_t fragment_size, MonotonicTime deadline) noexcept;
  void end(std::uint16_t index) noexcept;
  [[nodiscard]] OutgoingStream& items(std::uint16_t index) noexcept {
    return streams_[index].items;
  }
  /// Extends the lease, as its caller was heard. A stale frame does not shorten the lease.
  void extend(std::uint16_t index, MonotonicTime deadline) noexcept {
    streams_[index].deadline = std::max(streams_[index].deadline, deadline);
  }

  /// No lease ends before this.
  [[nodiscard]] MonotonicTime next_time() const noexcept { return due_; }
  /// Visits the call of each stream whose lease has ended; the visitor must end it.
  template <class Visitor>
  void visit_expired(MonotonicTime now, Visitor visit) noexcept {
    // The due time may be early, because leases only grow.
    if (now < due_) return;
    due_ = kNever;
    for (const Stream& stream : streams_) {
      if (!stream.items.is_begun()) continue;
      if (stream.deadline > now) {
        due_ = std::min(due_, stream.deadline);
      } else {
        visit(stream.call);
      }
    }
  }

  /// Lets next_repair() return the lost frames of a stream.
  void repair(std::uint16_t index) noexcept { repairing_ = index; }
  void stop_repair() noexcept { repairing_ = kNone; }
  [[nodiscard]] bool is_repairing() const noexcept { return repairing_ != kNone; }
  /// The call of the stream being repaired.
  [[nodiscard]] const CallPlace& repaired_call() const noexcept {
    return streams_[repairing_].call;
  }
  /// The next lost frame; empty if no more are known to be lost, which ends the repair.
  [[nodiscard]] ConstBytes next_repair() noexcept;

 private:
  struct Stream {
    CallPlace call{};
    MonotonicTime deadline{};
    OutgoingStream items;  ///< Valid while in use.
  };

  MutableBytes memory_;
  Medium medium_;
  std::vector<Stream> streams_;
  std::uint32_t open_count_ = 0;
  MonotonicTime due_ = kNever;
  std::uint16_t repairing_ = kNone;
};

}  // namespace rtpm::wire
