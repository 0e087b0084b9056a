#pragma once

#include <atomic>
#include <cstdint>

#include "model/lead.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/counters.hpp"
#include "rtpm/rpc/lane_table.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/wire/server_sessions.hpp"

namespace rtpm::rpc {

/// A lane's counts, and the slot of the lane table that publishes them to other processes.
/// @threads  the leader; functions without a Lead: any
/// @realtime alloc-free
class LaneReport {
 public:
  /// Publishes the lane's static configuration.
  LaneReport(LaneSlot& slot, const LaneConfig& config, const Band& band) noexcept;

  /// Counters to modify; the next publish() shows them.
  [[nodiscard]] ServerCounters& counters(Lead&) noexcept {
    is_due_ = true;
    return counters_;
  }
  [[nodiscard]] LaneSample& sample(Lead&) noexcept {
    is_due_ = true;
    return sample_;
  }
  /// Records a change of counts that `census` adds on publishing.
  void mark(Lead&) noexcept { is_due_ = true; }
  /// Records that a call's answer was written.
  void on_answered(Lead&, MonotonicTime now) noexcept { answered_ = now; }
  /// Records that a frame received at `received` was handled.
  void end_cycle(Lead&, MonotonicTime received) noexcept;
  /// Records that a request was answered at `now`, and counts it if that was too late.
  void on_end(Lead&, const wire::Request& request, wire::Status status, MonotonicTime now) noexcept;
  /// Records that `count` of the sessions' expired calls are streams whose callers fell silent.
  void on_silent(Lead&, std::uint64_t count) noexcept { silent_stream_count_ += count; }
  /// Records that a method was run inside another one.
  void on_nested(bool has_thrown) noexcept;

  /// Publishes the changes since the last time, if any.
  template <class Census>
  void publish(Lead&, Census census) noexcept {
    if (!is_due_) return;
    is_due_ = false;
    census(counters_, sample_);
    write();
  }
  [[nodiscard]] ServerCounters read() const noexcept {
    return slot_.sample.read().value_or(LaneSample{}).counters;
  }

 private:
  void write() noexcept;

  LaneSlot& slot_;
  bool is_due_ = false;
  MonotonicTime answered_{};
  std::uint64_t silent_stream_count_ = 0;
  /// The counts without nested calls, and without late calls, which the sessions count.
  ServerCounters counters_{};
  LaneSample sample_{};  ///< Without its counters, which write() adds.
  std::atomic<std::uint64_t> nested_count_{0};
  std::atomic<std::uint64_t> nested_failure_count_{0};
};

}  // namespace rtpm::rpc
