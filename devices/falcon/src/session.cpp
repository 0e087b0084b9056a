#include "rtpm/device_falcon/session.hpp"

#include <algorithm>
#include <cstdlib>

#include "rtpm/device_io/buttons.hpp"
#include "rtpm/driver/vector.hpp"

namespace rtpm::device_falcon {
namespace {

constexpr driver::Vector3 kStartMetres{0, 0, kZeroCountsZMetres};
/// A longer gap does not further extend how far a leg may move: otherwise a persistent jump would
/// be accepted.
constexpr std::int64_t kGapMillisecondMax = 2;
/// A unit that refuses does so immediately, so the time limit alone would allow too many attempts.
constexpr int kStopAttemptMax = 25;

bool is_within_reach(const driver::Vector3& position_m) {
  return length(difference(position_m, kCentreMetres)) < Session::kReachMetres;
}

}  // namespace

driver::Vector3 VelocityWindow::update(const driver::Vector3& position_m, MonotonicTime time) {
  // Two packets from one transfer have the same time: the newer one replaces the older.
  if (size_ == 0 || time > points_[newest_].time) {
    newest_ = (newest_ + 1) % kPointCount;
    size_ = std::min(size_ + 1, kPointCount);
  }
  points_[newest_] = {position_m, time};
  const Point& oldest = points_[(newest_ + kPointCount + 1 - size_) % kPointCount];
  const Duration span = time - oldest.time;
  if (span <= Duration{0}) return {};
  return scaled(difference(position_m, oldest.position_m),
                1 / std::chrono::duration<double>(span).count());
}

Session::Session(Transport& transport) : transport_(transport), answered_at_(transport.now()) {}

bool Session::step(const ForceRequest& request, Duration patience) {
  const MonotonicTime now = transport_.now();
  if (now - answered_at_ > kGoneAfter) return false;
  const bool is_due = !is_awaiting_ || now - sent_at_ >= kRepeatAfter;
  if (is_due && !send(request, now)) return false;
  const Received received = transport_.receive(transfer_, patience);
  if (received.status == UsbStatus::kGone || received.status == UsbStatus::kStalled) return false;
  if (received.status == UsbStatus::kOverflow) {
    ++refused_count_;
    parser_.reset();
  }
  if (received.status == UsbStatus::kOk) {
    const std::span<std::byte> bytes = std::span(transfer_).first(received.size);
    const std::uint64_t corrupt_count = parser_.corrupt_count();
    parser_.push(bytes.first(strip_status(bytes)),
                 [&](const EncoderReport& report) { take(report, received.time); });
    // A damaged answer is also an answer: the next packet need not wait.
    if (parser_.corrupt_count() != corrupt_count) is_awaiting_ = false;
  }
  state_.corrupt_count = parser_.corrupt_count() + refused_count_;
  return true;
}

bool Session::send(const ForceRequest& request, MonotonicTime now) {
  MotorRequest packet{.flags = kHomingFlag};
  const bool has_force = is_live(request, now) && state_.is_homed && is_sound_;
  if (has_force) packet.counts = request.counts;
  packet.flags |= !state_.is_homed                             ? kRedLedFlag
                  : has_force && request.counts != LegCounts{} ? kGreenLedFlag
                                                               : kBlueLedFlag;
  const UsbStatus status = transport_.send(encode(packet));
  if (status == UsbStatus::kBusy) return true;
  sent_at_ = now;
  is_awaiting_ = true;
  return status == UsbStatus::kOk;
}

bool Session::is_live(const ForceRequest& request, MonotonicTime now) {
  if (request.number != request_number_) {
    request_number_ = request.number;
    requested_at_ = now;
  }
  return request.number != 0 && now < request.deadline && now - requested_at_ < kRequestLife;
}

void Session::take(const EncoderReport& report, MonotonicTime time) {
  is_awaiting_ = false;
  take_homed(report.is_homed());
  is_sound_ = !state_.is_homed || take_position(report.counts, time);
  if (!is_sound_) {
    ++refused_count_;
    return;
  }
  take_buttons(report.buttons);
  state_.time = answered_at_ = time;
  ++state_.report_count;
}

/// Any bits of a damaged byte may be wrong: losing the homed state takes effect at once, gaining it
/// only after repetition.
void Session::take_homed(bool is_homed) {
  homed_packet_count_ = is_homed ? std::min(homed_packet_count_ + 1, kHomedPacketCount) : 0;
  state_.is_homed = homed_packet_count_ == kHomedPacketCount;
  if (state_.is_homed) return;
  counts_.reset();
  velocity_.reset();
}

bool Session::is_leap(const LegCounts& counts, MonotonicTime time) const {
  if (!counts_) return false;
  const auto gap_ms =
      std::chrono::duration_cast<std::chrono::milliseconds>(time - state_.time).count() + 1;
  const auto count_max = static_cast<int>(std::clamp<std::int64_t>(gap_ms, 1, kGapMillisecondMax)) *
                         kCountsPerMillisecondMax;
  for (std::size_t leg = 0; leg < counts.size(); ++leg) {
    if (std::abs(counts[leg] - (*counts_)[leg]) > count_max) return true;
  }
  return false;
}

bool Session::take_position(const LegCounts& counts, MonotonicTime time) {
  if (is_leap(counts, time)) return false;
  const auto position_m = forward(upper_angles(counts), counts_ ? state_.position_m : kStartMetres);
  if (!position_m || !is_within_reach(*position_m)) return false;
  counts_ = counts;
  state_.position_m = *position_m;
  state_.velocity_m_per_s = velocity_.update(*position_m, time);
  return true;
}

/// A button state is accepted when two packets agree on it.
void Session::take_buttons(std::uint8_t buttons) {
  const bool is_repeated = buttons == last_buttons_;
  last_buttons_ = buttons;
  if (!is_repeated) return;
  device_io::count_edges(state_.buttons, buttons, state_.button_edges);
  state_.buttons = buttons;
}

void Session::stop() {
  if (is_stopped_) return;
  is_stopped_ = true;
  const Packet zero = encode(MotorRequest{.flags = kHomingFlag | kRedLedFlag});
  const MonotonicTime end = transport_.now() + kStopPatience;
  int sent_count = 0;
  for (int attempt = 0; attempt < kStopAttemptMax && transport_.now() < end; ++attempt) {
    // The second packet is accepted only after the first has been sent.
    if (sent_count == 2) return;
    const UsbStatus status = transport_.send(zero);
    if (status == UsbStatus::kGone) return;
    if (status == UsbStatus::kOk) ++sent_count;
    const Received received = transport_.receive(transfer_, std::chrono::milliseconds{2});
    if (received.status == UsbStatus::kGone) return;
  }
}

}  // namespace rtpm::device_falcon
