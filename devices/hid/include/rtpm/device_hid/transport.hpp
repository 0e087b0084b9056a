#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::device_hid {

/// Longest report of any device that this driver takes, its number included.
inline constexpr std::size_t kReportSizeMax = 256;

/// Result of HidTransport::read().
struct Received {
  std::size_t size = 0;    ///< Bytes of the report; 0 if none came within the patience.
  bool is_closed = false;  ///< The device is gone.
};

/// Reports to and from one device, and the clock for waiting on them. The first byte of a written
/// report, and of a feature report, is its number, or 0 if the device numbers none. A report that
/// is read begins with its number only if the device numbers its reports.
/// @threads  read() and now() by one, the others by one that may be another
/// @realtime set-up only
class HidTransport {
 public:
  HidTransport() = default;
  HidTransport(const HidTransport&) = delete;
  HidTransport& operator=(const HidTransport&) = delete;
  /// Closes the device.
  virtual ~HidTransport() = default;

  /// Takes the oldest report that was not read yet; waits for one at most `patience`.
  [[nodiscard]] virtual Received read(MutableBytes buffer, Duration patience) = 0;
  /// Sends an output report and waits until the device has taken it, for seconds if it hangs.
  /// @return false if refused, or if the device is gone
  [[nodiscard]] virtual bool write(ConstBytes report) = 0;
  /// Asks for the feature report whose number is in `report[0]`.
  /// @return its size, its number included; 0 if refused, or if the device is gone
  [[nodiscard]] virtual std::size_t read_feature(MutableBytes report) = 0;
  /// The present time; never decreases.
  [[nodiscard]] virtual MonotonicTime now() const = 0;
};

/// How a device is connected: the same pad sends other reports by Bluetooth.
enum class Bus : std::uint8_t { kUsb, kBluetooth, kOther };

/// A HID device that is plugged in. The device's own words are not escaped.
/// @ownership a value
struct Unit {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  Bus bus = Bus::kUsb;
  std::string model{};   ///< The maker's name for it.
  std::string serial{};  ///< Empty if it has none.
  std::string port{};    ///< Its port, "usb-0000:00:14.0-2/input0"; empty if unknown.
  std::string node{};    ///< "/dev/hidraw0"; another one after it was plugged in again.
  std::vector<std::byte> report_descriptor{};  ///< Empty if it can't be read.
};

/// The HID devices of a machine.
/// @threads  one at a time
/// @realtime set-up only
class HidSystem {
 public:
  HidSystem() = default;
  HidSystem(const HidSystem&) = delete;
  HidSystem& operator=(const HidSystem&) = delete;
  virtual ~HidSystem() = default;

  /// The units that are plugged in now, also of other makers and kinds.
  [[nodiscard]] virtual std::vector<Unit> units() = 0;
  /// @errors   a right is missing, with the udev rule that gives it; the device is gone
  [[nodiscard]] virtual expected<std::unique_ptr<HidTransport>, SetupError> open(
      const Unit& unit) = 0;
};

/// The HID devices of this machine, through hidapi and udev.
/// @source   hidapi 0.13, hidraw backend
[[nodiscard]] std::unique_ptr<HidSystem> make_hid_system();

}  // namespace rtpm::device_hid
