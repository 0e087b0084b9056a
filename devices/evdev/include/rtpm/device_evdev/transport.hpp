#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/device_evdev/effects.hpp"
#include "rtpm/device_evdev/event.hpp"

namespace rtpm::device_evdev {

/// Result of Transport::read().
enum class ReadStatus : std::uint8_t {
  kOk,       ///< There may be no events, if none arrived within the patience.
  kCorrupt,  ///< The data did not consist of whole events and was dropped.
  kGone,     ///< The device is gone.
};
struct ReadResult {
  ReadStatus status = ReadStatus::kOk;
  std::size_t count = 0;
};

/// One opened input device.
/// @threads  read(): one thread; the other functions: another thread at the same time
class Transport {
 public:
  Transport() = default;
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;
  virtual ~Transport() = default;

  [[nodiscard]] virtual const Capabilities& capabilities() const = 0;
  /// Waits for events, for at most `patience`. After SYN_DROPPED come the differences to the
  /// current state, then a SYN_REPORT.
  [[nodiscard]] virtual ReadResult read(std::span<Event> events, Duration patience) noexcept = 0;
  /// Uploads a new effect and sets its id, or changes an existing effect.
  /// @return 0, or an errno
  [[nodiscard]] virtual int upload(Effect& effect) noexcept = 0;
  /// @return 0, or an errno
  [[nodiscard]] virtual int erase(int effect_id) noexcept = 0;
  /// Starts or stops an effect.
  /// @return 0, or an errno
  [[nodiscard]] virtual int play(int effect_id, bool is_on) noexcept = 0;
  /// @param share  fraction of the full gain, 0 to 1
  /// @return 0, or an errno
  [[nodiscard]] virtual int set_gain(double share) noexcept = 0;
  /// Sets the device's own centring spring to zero.
  /// @return 0, or an errno
  [[nodiscard]] virtual int disable_autocenter() noexcept = 0;
  /// The current time; never decreases.
  [[nodiscard]] virtual MonotonicTime now() const noexcept = 0;
};

/// A plugged-in input device.
struct Unit {
  std::string node;    ///< "/dev/input/event5".
  std::string name;    ///< The name that the device reports.
  std::string serial;  ///< Empty if the device has none.
  std::string path;    ///< The port, such as "pci-0000:00:14.0-usb-0:2:1.0"; empty if unknown.
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  bool is_joystick = false;  ///< Whether udev classifies it as a joystick, game pad or wheel.
};

/// The input devices of a machine.
struct Access {
  std::function<std::vector<Unit>()> list{};
  /// @param is_grabbed  if true, no other program gets its events
  /// @errors   the device is gone, a permission is missing; described in words
  std::function<expected<std::unique_ptr<Transport>, SetupError>(const Unit&, bool is_grabbed)>
      open{};
};

}  // namespace rtpm::device_evdev
