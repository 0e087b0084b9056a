#include "model/report.hpp"

#include <algorithm>

namespace rtpm::rpc {

LaneReport::LaneReport(LaneSlot& slot, const LaneConfig& config, const Band& band) noexcept
    : slot_(slot) {
  const std::size_t size = std::min(config.name.size(), slot.name.size() - 1);
  std::copy_n(config.name.begin(), size, slot.name.begin());
  slot.band_low = static_cast<std::uint16_t>(band.low.value());
  slot.band_high = static_cast<std::uint16_t>(band.high.value());
  slot.priority = static_cast<std::uint16_t>(config.priority.value());
  slot.wait = static_cast<std::uint8_t>(config.wait.strategy);
  slot.schedule = static_cast<std::uint8_t>(config.schedule);
}

void LaneReport::end_cycle(Lead&, MonotonicTime received) noexcept {
  const MonotonicTime end = std::max(answered_, received);
  is_due_ = true;
  ++sample_.cycle_count;
  sample_.last_cycle_end_ns = to_ns(end);
  sample_.longest_cycle_ns =
      std::max(sample_.longest_cycle_ns, std::int64_t{(end - received).count()});
}

// A stream's deadline is until when its caller must send its first sign of life; it no longer
// applies after that.
void LaneReport::on_end(Lead& lead, const wire::Request& request, wire::Status status,
                        MonotonicTime now) noexcept {
  const bool has_deadline = !request.wants_stream() || status == wire::Status::kExpired;
  if (has_deadline && now >= request.deadline) ++counters(lead).late_count;
}

void LaneReport::on_nested(bool has_thrown) noexcept {
  nested_count_.fetch_add(1, std::memory_order_relaxed);
  if (has_thrown) nested_failure_count_.fetch_add(1, std::memory_order_relaxed);
}

void LaneReport::write() noexcept {
  ServerCounters& shown = sample_.counters;
  shown = counters_;
  shown.late_count += counters_.frames.expired_count - silent_stream_count_;
  shown.call_count += nested_count_.load(std::memory_order_relaxed);
  shown.servant_failure_count += nested_failure_count_.load(std::memory_order_relaxed);
  slot_.sample.write(sample_);
}

}  // namespace rtpm::rpc
