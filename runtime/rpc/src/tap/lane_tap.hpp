#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <vector>

#include "rtpm/rpc/tap.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "tap/tap_ring.hpp"

namespace rtpm::rpc {

/// Which calls are wanted, of each object by its number. Constant while lanes use it.
struct TapFilter {
  struct Wish {
    bool is_wanted = false;
    std::vector<std::uint16_t> methods{};  ///< Empty: all.
  };
  std::vector<Wish> wishes{};
  bool has_payloads = true;
  std::uint32_t payload_byte_max = 0;

  [[nodiscard]] bool wants(const wire::Header& header) const noexcept {
    // hp-6: the session service is 0, and has no object.
    const std::uint32_t index = header.service - 1;
    if (index >= wishes.size() || !wishes[index].is_wanted) return false;
    const std::vector<std::uint16_t>& methods = wishes[index].methods;
    return methods.empty() ||
           std::ranges::find(methods, header.method) != methods.end();
  }
};

/// That a call which goes on after its method was tapped, and when.
struct TapMark {
  std::uint64_t number = 0;      ///< 0: it was not.
  std::uint64_t generation = 0;  ///< Of the tap, which may have been off since.
};

/// What of a call is recorded.
struct TapDraft {
  const wire::Request& request;
  TapStage stage;
  wire::Status status;
  ConstBytes request_payload;
  ConstBytes reply_payload;
};

/// What one lane records while the tap is on.
struct LaneTape {
  LaneTape(const TapFilter& its_filter, std::uint32_t ring_byte_count, std::uint32_t first_number,
           std::uint64_t its_generation, std::uint32_t its_lane, std::uint32_t its_lane_count)
      : filter(its_filter),
        generation(its_generation),
        lane(its_lane),
        lane_count(its_lane_count),
        ring(ring_byte_count, first_number) {}

  /// @return the call's number; 0: nothing was written
  std::uint64_t write(const TapDraft& draft, std::uint64_t known_number) noexcept;

  const TapFilter& filter;
  std::uint64_t generation;
  std::uint32_t lane;
  std::uint32_t lane_count;
  TapRing ring;
  std::atomic<std::uint64_t> dropped_count{0};
  std::atomic<std::uint64_t> omitted_payload_count{0};
};

/// Where a lane's threads hand over the calls that the server's tap wants.
/// @threads  connect() and disconnect() one; the rest any of the lane
/// @realtime wait-free, alloc-free, no syscall
class LaneTap {
 public:
  [[nodiscard]] bool is_on() const noexcept {
    return tape_.load(std::memory_order_relaxed) != nullptr;
  }
  /// A call that has been answered.
  void on_whole(const wire::Request& request, wire::Status status, ConstBytes reply) noexcept;
  /// A call whose method returned, and that goes on.
  [[nodiscard]] TapMark on_begun(const wire::Request& request) noexcept;
  /// An item of such a call.
  void on_item(const TapMark& mark, const wire::Request& request, ConstBytes item) noexcept;
  /// Such a call has been answered.
  void on_ended(const TapMark& mark, const wire::Request& request, wire::Status status,
                ConstBytes reply) noexcept;

  void connect(LaneTape& tape) noexcept { tape_.store(&tape, std::memory_order_seq_cst); }
  void disconnect() noexcept { tape_.store(nullptr, std::memory_order_seq_cst); }
  /// Whether a thread may still use the tape from before disconnect().
  [[nodiscard]] bool is_in_use() const noexcept {
    // SYNC POINT tap-off
    return writer_count_.load(std::memory_order_seq_cst) != 0;
  }

 private:
  /// @param mark  of the call, if it had begun before
  TapMark record(const TapDraft& draft, const TapMark& mark) noexcept;

  std::atomic<LaneTape*> tape_{nullptr};
  alignas(64) std::atomic<std::uint32_t> writer_count_{0};
};

}  // namespace rtpm::rpc
