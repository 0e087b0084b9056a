#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/driver/sample.hpp"
#include "touch_event.hpp"

namespace rtpm::scene {

/// Measures how often something arrives.
class Pace {
 public:
  void record(MonotonicTime now) noexcept {
    if (count_++ == 0) first_ = now;
    last_ = now;
  }
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  /// The mean rate between the first and the last arrival.
  [[nodiscard]] double rate_hz() const noexcept;
  /// Whether nothing has arrived for half a second, or at all.
  [[nodiscard]] bool is_silent(MonotonicTime now) const noexcept;

 private:
  std::uint64_t count_ = 0;
  MonotonicTime first_{};
  MonotonicTime last_{};
};

/// The counts and newest values that a graphics node received.
struct Sight {
  Pace samples{};
  Pace touches{};
  std::uint64_t contact_count = 0;  ///< Touches inside the solid.
  /// Contacts whose proxy was at the surface; otherwise it was inside or above the solid.
  std::uint64_t on_surface_count = 0;
  double force_newton_max = 0;
  double depth_m_max = 0;
  std::optional<driver::Sample> sample{};  ///< The newest sample.
  std::optional<TouchReport> touch{};      ///< The newest touch.
};

/// The part of a run that is drawn.
struct History {
  std::vector<driver::Vector3> device_m{};
  std::vector<TouchReport> touches{};
};

/// Collects the samples of a device and the touches of its force node.
/// @threads  any
class View {
 public:
  /// Over a minute at 60 Hz; the oldest entries are dropped.
  static constexpr std::size_t kHistoryMax = 4096;

  void see(const driver::Sample& sample, MonotonicTime now);
  void see(const TouchReport& report, MonotonicTime now);
  [[nodiscard]] Sight sight() const;
  /// The newest `count_max` samples and touches.
  [[nodiscard]] History history(std::size_t count_max) const;

 private:
  mutable std::mutex mutex_{};
  // Guarded by `mutex_`.
  Sight sight_{};
  std::deque<driver::Vector3> device_m_{};
  std::deque<TouchReport> touches_{};
};

/// One line: position, depth, force, and which nodes are silent.
/// @realtime set-up only
[[nodiscard]] std::string status_text(const Sight& sight, MonotonicTime now, Duration since_start);
/// The text below a picture: "lab/arm0 at the sphere: greatest depth 3.0 mm, greatest force 1.80
/// N".
/// @realtime set-up only
[[nodiscard]] std::string caption_text(const Sight& sight, const std::string& device);
/// One line for the end of a run.
/// @realtime set-up only
[[nodiscard]] std::string summary_text(const Sight& sight, std::uint64_t frame_count,
                                       Duration since_start);

}  // namespace rtpm::scene
