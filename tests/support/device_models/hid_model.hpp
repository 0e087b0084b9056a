#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

namespace rtpm::test {

/// A HID report as it crosses hidraw: its number first, if the device numbers its reports.
using HidReport = std::vector<std::uint8_t>;

struct HidIdentity {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  bool is_bluetooth = false;
  std::string name{};
};

/// A HID device without hardware, clock and transport: its descriptors, its input reports over
/// time, and its reaction to the reports that it gets. It fits behind a scripted transport,
/// umockdev and uhid.
/// @threads  one at a time
class HidModel {
 public:
  HidModel() = default;
  HidModel(const HidModel&) = delete;
  HidModel& operator=(const HidModel&) = delete;
  virtual ~HidModel() = default;

  [[nodiscard]] virtual HidIdentity identity() const = 0;
  [[nodiscard]] virtual HidReport report_descriptor() const = 0;
  /// Moves time on: the device queues the input reports of this time.
  virtual void advance(std::chrono::nanoseconds time) = 0;
  /// Takes an output report; `report[0]` is its number, 0 without numbers.
  /// @return false if the device refuses it
  virtual bool write(const HidReport& report) = 0;
  /// @return the feature report, its number first; empty if there is none
  [[nodiscard]] virtual HidReport read_feature(std::uint8_t) { return {}; }
  /// Whether there is no vibration, no light and no torque.
  [[nodiscard]] virtual bool is_safe() const = 0;

  /// The operator presses or releases a button.
  virtual void press(int button, bool is_pressed) = 0;
  /// The operator moves the axis: -1 to 1.
  virtual void move(int axis, double share) = 0;

  /// Takes the oldest input report out of the queue; false if there is none.
  [[nodiscard]] bool take_input(HidReport& report) {
    if (inputs_.empty()) return false;
    report = std::move(inputs_.front());
    inputs_.pop_front();
    return true;
  }

 protected:
  /// Linux, too, keeps the newest 64 for an opener that does not read.
  void queue(HidReport report) {
    if (inputs_.size() == 64) inputs_.pop_front();
    inputs_.push_back(std::move(report));
  }

 private:
  std::deque<HidReport> inputs_{};
};

/// A device that sends a report in each period.
class PeriodicHidModel : public HidModel {
 public:
  explicit PeriodicHidModel(std::chrono::nanoseconds period) : period_(period) {}
  void advance(std::chrono::nanoseconds time) override {
    for (elapsed_ += time; elapsed_ >= period_; elapsed_ -= period_)
      send_period();
  }

 protected:
  virtual void send_period() = 0;

 private:
  std::chrono::nanoseconds period_;
  std::chrono::nanoseconds elapsed_{0};
};

inline void put_le(HidReport& report, std::size_t at, std::uint64_t value, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i)
    report[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
}
[[nodiscard]] inline std::uint64_t get_le(const HidReport& report, std::size_t at,
                                          std::size_t size) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size; ++i)
    value |= static_cast<std::uint64_t>(report[at + i]) << (8 * i);
  return value;
}

}  // namespace rtpm::test
