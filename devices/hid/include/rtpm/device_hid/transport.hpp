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

/// Size of the longest report of all supported devices, including the report number.
inline constexpr std::size_t kReportSizeMax = 256;

/// Result of HidTransport::read().
struct Received {
  std::size_t size = 0;    ///< Bytes of the report; 0 if none arrived within the patience.
  bool is_closed = false;  ///< The device is gone.
};

/// Reports to and from one device, and the clock for waiting on them. The first byte of a written
/// report or a feature report is its number, or 0 if the device does not number its reports. A
/// report that is read starts with its number only if the device numbers its reports.
/// @threads  read() and now(): one thread; the other functions: one thread, which may be another
/// @realtime set-up only
class HidTransport {
 public:
  HidTransport() = default;
  HidTransport(const HidTransport&) = delete;
  HidTransport& operator=(const HidTransport&) = delete;
  /// Closes the device.
  virtual ~HidTransport() = default;

  /// Reads the oldest unread report; waits for one for at most `patience`.
  [[nodiscard]] virtual Received read(MutableBytes buffer, Duration patience) = 0;
  /// Sends an output report and waits until the device has accepted it, which may take seconds if
  /// it hangs.
  /// @return false if the report was refused or the device is gone
  [[nodiscard]] virtual bool write(ConstBytes report) = 0;
  /// Reads the feature report with the number in `report[0]`.
  /// @return the size, including the number; 0 if it was refused or the device is gone
  [[nodiscard]] virtual std::size_t read_feature(MutableBytes report) = 0;
  /// The current time; never decreases.
  [[nodiscard]] virtual MonotonicTime now() const = 0;
};

/// How a device is connected: the same pad sends different reports over Bluetooth.
enum class Bus : std::uint8_t { kUsb, kBluetooth, kOther };

/// A plugged-in HID device. Text from the device is not escaped.
/// @ownership a value
struct Unit {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  Bus bus = Bus::kUsb;
  std::string model{};   ///< The product name given by the maker.
  std::string serial{};  ///< Empty if it has none.
  std::string port{};    ///< For example "usb-0000:00:14.0-2/input0"; empty if unknown.
  std::string node{};  ///< For example "/dev/hidraw0"; changes when the device is plugged in again.
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

  /// The plugged-in units, including those of other makers and kinds.
  [[nodiscard]] virtual std::vector<Unit> units() = 0;
  /// @errors   a permission is missing, with the udev rule that grants it; another program holds the
  ///           device (Windows); the device is gone
  [[nodiscard]] virtual expected<std::unique_ptr<HidTransport>, SetupError> open(
      const Unit& unit) = 0;
};

/// The HID devices of this machine, through hidapi. On Windows, each top-level collection of a device
/// is a unit.
/// @source   hidapi 0.13, backends hidraw and Windows
[[nodiscard]] std::unique_ptr<HidSystem> make_hid_system();

}  // namespace rtpm::device_hid
