#include "rtpm/safety/flight_recorder.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

namespace rtpm::gvd {
namespace {

using driver::Fault;

/// The latched fault that newly appeared in `now`.
FlightCause cause_of(driver::Faults before, driver::Faults now) noexcept {
  const auto begins = [&](Fault fault) { return now.has(fault) && !before.has(fault); };
  if (begins(Fault::kEmergencyStop)) return FlightCause::kEmergencyStop;
  if (begins(Fault::kDeviceGone)) return FlightCause::kDeviceGone;
  if (begins(Fault::kTooFast)) return FlightCause::kTooFast;
  if (begins(Fault::kCommandNotFinite)) return FlightCause::kCommandNotFinite;
  return FlightCause::kNone;
}

void add(std::string& text, double value) {
  std::array<char, 32> digits{};
  std::snprintf(digits.data(), digits.size(), ",%.9g", value);
  text += digits.data();
}

void add(std::string& text, const driver::Vector3& vector) {
  add(text, vector.x);
  add(text, vector.y);
  add(text, vector.z);
}

void add(std::string& text, const driver::Wrench& wrench) {
  add(text, wrench.force_newton);
  add(text, wrench.torque_newton_metre);
}

std::string columns() {
  std::string text = "cycle,time_ns,has_command,gain,heat,energy_joule";
  for (const char* group :
       {"position_%c_m", "velocity_%c_m_per_s", "received_%c_newton", "received_%c_newton_metre",
        "applied_%c_newton", "applied_%c_newton_metre"}) {
    for (const char axis : {'x', 'y', 'z'}) {
      std::string name = group;
      name.replace(name.find("%c"), 2, 1, axis);
      text += "," + name;
    }
  }
  return text + ",faults\n";
}

}  // namespace

std::string_view to_string(FlightCause cause) noexcept {
  switch (cause) {
    case FlightCause::kNone:
      return "none";
    case FlightCause::kCommandNotFinite:
      return "command not finite";
    case FlightCause::kTooFast:
      return "too fast";
    case FlightCause::kEmergencyStop:
      return "emergency stop";
    case FlightCause::kDeviceGone:
      return "device gone";
  }
  return "unknown";
}

std::string to_csv(const FlightLog& log) {
  std::string text = "# fault " + std::to_string(log.number) + ": " +
                     std::string(to_string(log.cause)) + " in cycle " + std::to_string(log.cycle) +
                     "\n" + columns();
  for (const FlightRecord& record : log.records) {
    text += std::to_string(record.cycle) + "," +
            std::to_string(record.time.time_since_epoch().count()) +
            (record.has_command ? ",1" : ",0");
    add(text, record.gain);
    add(text, record.heat);
    add(text, record.energy_joule);
    add(text, record.position_m);
    add(text, record.velocity_m_per_s);
    add(text, record.received);
    add(text, record.applied);
    text += ",\"" + driver::to_text(record.faults) + "\"\n";
  }
  return text;
}

void FlightRecorder::record(const FlightRecord& record) noexcept {
  rings_[writing_][count_ % kCycleCount] = record;
  ++count_;
  const FlightCause cause = cause_of(last_faults_, record.faults);
  last_faults_ = record.faults;
  // A fault during the cycles after another one belongs to the same log.
  if (pending_cause_ == FlightCause::kNone && cause != FlightCause::kNone) {
    pending_cause_ = cause;
    pending_cycle_ = record.cycle;
    cycles_left_ = kAfterCount;
    return;
  }
  if (pending_cause_ == FlightCause::kNone) return;
  if (cycles_left_ > 0) --cycles_left_;
  if (cycles_left_ == 0) freeze();
}

// The writer backs off: while a reader copies, the log is frozen in a later cycle.
void FlightRecorder::freeze() noexcept {
  is_swapping_.store(true);
  if (reader_count_.load() == 0) {
    cause_ = pending_cause_;
    cycle_ = pending_cycle_;
    frozen_count_ = count_;
    writing_ = 1 - writing_;
    count_ = 0;
    pending_cause_ = FlightCause::kNone;
    number_.fetch_add(1, std::memory_order_release);
  }
  is_swapping_.store(false);
}

FlightLog FlightRecorder::newest(std::size_t first, std::size_t count) const {
  FlightLog log;
  log.records.reserve(std::min(count, kCycleCount));
  // A swap is a few assignments by a thread of higher priority, so sleeping is not worthwhile.
  for (reader_count_.fetch_add(1); is_swapping_.load(); reader_count_.fetch_add(1))
    reader_count_.fetch_sub(1);
  log.number = number_.load(std::memory_order_acquire);
  if (log.number > 0) {
    log.cause = cause_;
    log.cycle = cycle_;
    const Ring& ring = rings_[log.number % 2 == 1 ? 0 : 1];
    const std::uint64_t size = std::min<std::uint64_t>(frozen_count_, kCycleCount);
    log.record_count = size;
    const std::uint64_t begin = frozen_count_ - size + std::min<std::uint64_t>(first, size);
    const std::uint64_t end = begin + std::min<std::uint64_t>(count, frozen_count_ - begin);
    for (std::uint64_t i = begin; i < end; ++i)
      log.records.push_back(ring[i % kCycleCount]);
  }
  reader_count_.fetch_sub(1);
  return log;
}

}  // namespace rtpm::gvd
