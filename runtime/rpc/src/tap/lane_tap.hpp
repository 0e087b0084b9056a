#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "rtpm/rpc/tap.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "tap/tap_ring.hpp"

namespace rtpm::rpc {

/// The calls to record, of each object by its number. Constant while lanes use it.
struct TapFilter {
  enum class Interest : std::uint8_t { kNone, kSome, kAll };
  std::vector<Interest> interests{};
  std::vector<std::vector<std::uint16_t>> methods{};  ///< The methods of each object with kSome.
  bool has_payloads = true;
  std::uint32_t payload_byte_max = 0;  ///< 0 to omit payloads.

  [[nodiscard]] bool wants(const wire::Header& header) const noexcept {
    // hp-6: the session service is 0, and has no object.
    const std::uint32_t index = header.service - 1;
    if (index >= interests.size()) return false;
    if (interests[index] != Interest::kSome) [[likely]]
      return interests[index] == Interest::kAll;
    return std::ranges::count(methods[index], header.method) > 0;
  }
};

/// Whether, and when, an unfinished call was recorded.
struct TapMark {
  std::uint64_t number = 0;      ///< 0 if it was not recorded.
  std::uint64_t generation = 0;  ///< The tap's generation: it may have been off meanwhile.
};

/// The recorded parts of a call.
struct TapDraft {
  const wire::Request& request;
  TapStage stage;
  wire::Status status;
  ConstBytes request_payload;
  ConstBytes reply_payload;
  std::uint64_t number;  ///< 0 for the next number.
  MonotonicTime finished;
};

/// The filter and the ring of one writer of a lane while the tap is on.
/// @threads  write(): one at a time; the rest: any
/// @realtime write(): wait-free, alloc-free
struct TapTrack {
  TapTrack(const TapFilter& its_filter, std::uint64_t its_generation,
           std::uint64_t its_first_number, std::uint64_t its_number_step,
           std::uint32_t ring_byte_count)
      : filter(its_filter),
        generation(its_generation),
        next_number(its_first_number),
        number_step(its_number_step),
        ring(ring_byte_count) {}

  /// @return the call's number; 0 if nothing was written
  std::uint64_t write(const TapDraft& draft) noexcept;

  const TapFilter& filter;
  std::uint64_t generation;
  std::uint64_t next_number;  ///< Used by the writer only.
  std::uint64_t number_step;
  TapRing ring;
  std::atomic<std::uint64_t> dropped_count{0};
  std::atomic<std::uint64_t> omitted_payload_count{0};
};

/// Where a lane's threads hand over the calls that the server's tap records.
/// @threads  connect() and disconnect(): one; the rest: any of the lane's
/// @realtime wait-free, alloc-free, no syscall
class LaneTap {
 public:
  /// How many threads of a pool may write concurrently; a lane with one thread has one writer.
  static constexpr std::uint32_t kWriterCountMax = 4;

  explicit LaneTap(bool has_pool) noexcept : writer_count_(has_pool ? kWriterCountMax : 1) {}

  [[nodiscard]] bool is_on() const noexcept { return is_on_.load(std::memory_order_relaxed); }
  /// Records an answered call.
  [[gnu::noinline]] void on_whole(const wire::Request& request, wire::Status status,
                                  ConstBytes reply) noexcept;
  /// Records a call that continues after its method returned.
  [[nodiscard, gnu::noinline]] TapMark on_begun(const wire::Request& request) noexcept;
  /// Records an item of an unfinished call.
  void on_item(const TapMark& mark, const wire::Request& request, ConstBytes item) noexcept;
  /// Records the answer of an unfinished call.
  void on_ended(const TapMark& mark, const wire::Request& request, wire::Status status,
                ConstBytes reply) noexcept;

  [[nodiscard]] std::uint32_t writer_count() const noexcept { return writer_count_; }
  /// `track`: the track of writer `number`.
  void connect(std::uint32_t number, TapTrack& track) noexcept {
    writers_[number].track.store(&track, std::memory_order_seq_cst);
    is_on_.store(true, std::memory_order_relaxed);
  }
  void disconnect() noexcept;
  /// Whether a thread may still use a track from before disconnect().
  [[nodiscard]] bool is_in_use() const noexcept;
  /// Calls that found all writers busy since the last query.
  [[nodiscard]] std::uint64_t take_busy_count() noexcept {
    return busy_count_.exchange(0, std::memory_order_relaxed);
  }

 private:
  struct alignas(64) Writer {
    std::atomic<bool> is_busy{false};
    std::atomic<TapTrack*> track{nullptr};  ///< Null while the tap is off.
  };
  template <class Use>
  void with_track(Use use) noexcept;

  std::atomic<bool> is_on_{false};
  std::uint32_t writer_count_;
  std::atomic<std::uint64_t> busy_count_{0};
  std::array<Writer, kWriterCountMax> writers_{};
};

}  // namespace rtpm::rpc
