#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <span>
#include <string>

#include "rtpm/driver/descriptor.hpp"
#include "rtpm/gvd/consumer.hpp"

namespace rtpm::display {

/// The counters that a display keeps of a device.
struct Sight {
  std::uint64_t sample_count = 0;  ///< Samples shown; the hub has dropped the others.
  std::uint64_t cycle_count = 0;   ///< The device's cycles, from the first to the last one shown.
  std::uint64_t press_count = 0;
  std::uint64_t contact_count = 0;
  std::uint64_t lease_count = 0;
  std::uint64_t other_count = 0;  ///< Changes of other kinds.
  std::uint64_t gap_count = 0;    ///< How often the hub was lost.
};

/// Collects the events of one device.
/// @threads  any
class View final : public gvd::DeviceEventHandler {
 public:
  /// @param curve_size  how many shown samples the curve contains
  View(std::string name, driver::Descriptor descriptor, std::size_t curve_size)
      : name_(std::move(name)), descriptor_(std::move(descriptor)), curve_size_(curve_size) {}

  void on_events(std::span<const gvd::DeviceEvent> events) override;
  void on_notice(const events::Notice& notice) override;

  /// The device in one line, at most `width` columns wide.
  [[nodiscard]] std::string line(std::size_t name_width, std::size_t width) const;
  [[nodiscard]] Sight sight() const;
  [[nodiscard]] const std::string& name() const noexcept { return name_; }

 private:
  void see(const gvd::DeviceEvent& event);
  void see(const driver::Sample& sample);
  [[nodiscard]] std::string state_text() const;

  std::string name_;
  driver::Descriptor descriptor_;
  std::size_t curve_size_;
  mutable std::mutex mutex_{};
  // Guarded by `mutex_`.
  std::optional<driver::Sample> newest_{};
  std::uint64_t first_cycle_ = 0;
  std::deque<double> curve_{};
  bool is_touching_ = false;
  bool is_silent_ = false;
  bool is_cut_off_ = false;
  Sight sight_{};
};

}  // namespace rtpm::display
