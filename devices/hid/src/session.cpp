#include "rtpm/device_hid/session.hpp"

#include <array>

namespace rtpm::device_hid {

Reader::Reader(HidTransport& transport, Profile& profile, State& state)
    : transport_(transport),
      profile_(profile),
      state_(state),
      silence_max_(profile.silence_max()),
      heard_at_(transport.now()) {}

bool Reader::step(Duration patience) {
  // Limits the loop for a device that sends too many reports: Linux queues 64 reports.
  constexpr int kReportCountMax = 64;
  std::array<std::byte, kReportSizeMax> buffer;
  for (int i = 0; i < kReportCountMax; ++i) {
    const Received received = transport_.read(buffer, i == 0 ? patience : Duration{0});
    if (received.is_closed) return false;
    if (received.size == 0) break;
    const MonotonicTime now = transport_.now();
    const Verdict verdict = profile_.take(ConstBytes(buffer).first(received.size), now, state_);
    if (verdict == Verdict::kCorrupt) ++corrupt_count_;
    if (verdict == Verdict::kNew) {
      ++report_count_;
      heard_at_ = now;
    }
  }
  return !silence_max_ || transport_.now() - heard_at_ <= kGoneAfter;
}

bool Reader::is_late() const {
  return silence_max_ && transport_.now() - heard_at_ > *silence_max_;
}

std::optional<MonotonicTime> Reader::measured_at() const {
  return silence_max_ && report_count_ > 0 ? std::optional(heard_at_) : std::nullopt;
}

bool Writer::write(const Request& request) {
  const OutputReport report = profile_.encode(request);
  return report.size == 0 || transport_.write(report.view());
}

void Writer::step(const Request& request, MonotonicTime now) {
  const bool is_active = request != safe_;
  const Duration wait = is_refused() ? kRetryPeriod : kRepeatPeriod;
  const bool is_repeat_due = now - written_at_ >= wait && (is_active || is_refused());
  const bool is_change = request != delivered_ && !is_refused();
  if (!is_change && !is_repeat_due) return;
  written_at_ = now;
  if (!write(request)) {
    if (!is_gone()) ++refusal_count_;
    return;
  }
  refusal_count_ = 0;
  delivered_ = request;
}

void Writer::make_safe() {
  constexpr int kAttemptCount = 3;
  for (int i = 0; i < kAttemptCount; ++i) {
    if (write(safe_)) break;
  }
  delivered_ = safe_;
}

}  // namespace rtpm::device_hid
