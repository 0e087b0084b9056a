#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::device_bridges {

/// How a HID device presents itself.
struct HidIdentity {
  std::uint16_t bus = 0x03;  ///< BUS_USB. hidapi 0.13 opens such a device without a USB parent.
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::uint16_t version = 0;
  std::string name{};           ///< At most 127 bytes.
  std::string serial_number{};  ///< At most 63 bytes.
};

/// The behaviour of a HID device. All functions are called from the bridge's thread, one at a time;
/// a missing function refuses.
struct HidModel {
  HidIdentity identity{};
  std::vector<std::byte> report_descriptor{};  ///< At most 4096 bytes.
  /// The input report that is due, as it goes over the bus: its number first if reports are
  /// numbered. Empty if none is due.
  std::function<std::vector<std::byte>(MonotonicTime now)> next_input_report{};
  /// An output report, its number first (0 if reports are not numbered).
  std::function<void(std::span<const std::byte> report)> on_output_report{};
  /// Returns a feature report, its number first; empty to refuse.
  std::function<std::vector<std::byte>(std::uint8_t number)> on_get_feature_report{};
  /// Takes a feature report, its number first; false to refuse it.
  std::function<bool(std::span<const std::byte> report)> on_set_feature_report{};
};

/// Puts a model behind the kernel's HID stack through /dev/uhid, so that hidraw, evdev and hidapi
/// see it as hardware.
/// @threads  one; the model's functions run on the bridge's own thread
/// @source   the kernel's Documentation/hid/uhid.rst
class UhidBridge {
 public:
  /// @param period  how often the model is asked for an input report
  explicit UhidBridge(HidModel model, Duration period = std::chrono::milliseconds{1})
      : model_(std::move(model)), period_(period) {}
  UhidBridge(const UhidBridge&) = delete;
  UhidBridge& operator=(const UhidBridge&) = delete;
  /// Unplugs.
  ~UhidBridge() { unplug(); }

  /// Makes the device appear. The kernel goes on to set it up after this returns.
  /// @errors   no /dev/uhid, no right to it, or the kernel refuses the device
  [[nodiscard]] expected<void, SetupError> plug();
  /// Unplugs the device, in use or not. The model keeps its state. No effect if not plugged in.
  void unplug() noexcept;

  /// Calls `function` while no function of the model runs.
  template <class Function>
  auto with_model(Function function) {
    const std::lock_guard lock(mutex_);
    return function();
  }

 private:
  void serve();
  void send_input_report();
  void take_event();

  HidModel model_;
  Duration period_;
  std::mutex mutex_{};
  std::atomic<bool> is_stopping_{false};
  int handle_ = -1;
  std::thread thread_{};
};

}  // namespace rtpm::device_bridges
