#pragma once

#include <cstdint>
#include <optional>

#include "rtpm/device_hid/profile.hpp"
#include "rtpm/device_hid/transport.hpp"

namespace rtpm::device_hid {

/// Reads a device's reports. The newest report determines the state, but each button edge is
/// counted.
/// @ownership refers to all three arguments, which must outlive it
/// @threads  one at a time
/// @realtime set-up only
class Reader {
 public:
  /// A device that reports continuously counts as gone after this silence.
  static constexpr Duration kGoneAfter = std::chrono::seconds{1};

  Reader(HidTransport& transport, Profile& profile, State& state);

  /// Waits for a report for at most `patience`, and reads all that have arrived.
  /// @return false if the device is gone
  [[nodiscard]] bool step(Duration patience);
  /// Whether the device has been silent for longer than a healthy one.
  [[nodiscard]] bool is_late() const;
  [[nodiscard]] std::uint64_t report_count() const noexcept { return report_count_; }
  [[nodiscard]] std::uint64_t corrupt_count() const noexcept { return corrupt_count_; }
  /// When the last valid report arrived; nullopt if none arrived or if the device reports only
  /// changes, so that its state stays valid.
  [[nodiscard]] std::optional<MonotonicTime> measured_at() const;

 private:
  HidTransport& transport_;
  Profile& profile_;
  State& state_;
  std::optional<Duration> silence_max_;
  MonotonicTime heard_at_;
  std::uint64_t report_count_ = 0;
  std::uint64_t corrupt_count_ = 0;
};

/// Writes requests to a device when they change.
/// @ownership refers to both arguments, which must outlive it
/// @threads  one at a time; a write may take several seconds
/// @realtime set-up only
class Writer {
 public:
  /// Interval at which a request other than `safe` is repeated, in case the device has lost it.
  static constexpr Duration kRepeatPeriod = std::chrono::milliseconds{500};
  /// Interval at which a refused request is repeated, and number of refusals after which the device
  /// counts as gone.
  static constexpr Duration kRetryPeriod = std::chrono::milliseconds{20};
  static constexpr int kRefusalMax = 10;

  Writer(HidTransport& transport, Profile& profile, const Request& safe)
      : transport_(transport), profile_(profile), safe_(safe), delivered_(safe) {}

  /// Writes `request` if it has changed or must be repeated.
  void step(const Request& request, MonotonicTime now);
  /// Writes the safe values; tries several times if the device refuses.
  void make_safe();

  /// The last request that the device accepted.
  [[nodiscard]] const Request& delivered() const noexcept { return delivered_; }
  [[nodiscard]] bool is_refused() const noexcept { return refusal_count_ > 0; }
  [[nodiscard]] bool is_gone() const noexcept { return refusal_count_ >= kRefusalMax; }

 private:
  [[nodiscard]] bool write(const Request& request);

  HidTransport& transport_;
  Profile& profile_;
  Request safe_;
  Request delivered_;
  MonotonicTime written_at_{};
  int refusal_count_ = 0;
};

}  // namespace rtpm::device_hid
