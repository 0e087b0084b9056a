#include "drivers.hpp"

#include <algorithm>
#include <array>

#include "rtpm/device_sim/biometric_driver.hpp"
#include "rtpm/device_sim/gaze_driver.hpp"
#include "rtpm/device_sim/knob_driver.hpp"
#include "rtpm/device_sim/player_driver.hpp"
#include "rtpm/device_sim/sim_driver.hpp"
#include "rtpm/device_sim/stimulus_driver.hpp"
#include "rtpm/driver_host/plugin.hpp"

/// Initializes `make` and `probe` of a DriverInfo for a driver whose namespace has open() and
/// probe().
#define RTPM_HARDWARE(part)                                                                       \
  [](const DeviceSettings& device) -> Made { return part::open(device.arguments, device.name); }, \
      [] { return part::probe(); }

// A driver whose library was not found, or that this system does not have, is not built, so its header
// is not included.
#if __has_include("rtpm/device_evdev/open.hpp")
#include "rtpm/device_evdev/open.hpp"
#define RTPM_EVDEV RTPM_HARDWARE(device_evdev)
#else
#define RTPM_EVDEV nullptr, nullptr
#endif
#if __has_include("rtpm/device_falcon/open.hpp")
#include "rtpm/device_falcon/open.hpp"
#define RTPM_FALCON RTPM_HARDWARE(device_falcon)
#else
#define RTPM_FALCON nullptr, nullptr
#endif
#if __has_include("rtpm/device_hid/open.hpp")
#include "rtpm/device_hid/open.hpp"
#define RTPM_HID RTPM_HARDWARE(device_hid)
#else
#define RTPM_HID nullptr, nullptr
#endif
#if __has_include("rtpm/device_serial/open.hpp")
#include "rtpm/device_serial/open.hpp"
#define RTPM_SERIAL RTPM_HARDWARE(device_serial)
#else
#define RTPM_SERIAL nullptr, nullptr
#endif
#if __has_include("rtpm/device_mpv/mpv_driver.hpp")
#include "rtpm/device_mpv/mpv_driver.hpp"
#include "rtpm/device_mpv/settings.hpp"
#define RTPM_MPV &make_mpv
#else
#define RTPM_MPV nullptr
#endif
#if __has_include("rtpm/device_vrpn/vrpn_driver.hpp")
#include "rtpm/device_vrpn/vrpn_driver.hpp"
#define RTPM_VRPN &make_vrpn
#else
#define RTPM_VRPN nullptr
#endif

namespace rtpm::deviced {
namespace {

using Made = expected<std::unique_ptr<driver::Driver>, SetupError>;

/// The encoder error of a real, uncalibrated arm.
constexpr double kEncoderErrorMetres = 1e-3;

device_sim::TwinConfig twin_of(const DeviceSettings& device) {
  device_sim::TwinConfig twin;
  twin.serial = device.serial.empty() ? "sim-" + device.name : device.serial;
  twin.frame = device.name + "/base";
  twin.seed = device.seed;
  return twin;
}

Made make_arm(const DeviceSettings& device) {
  const device_sim::TwinConfig twin = twin_of(device);
  device_sim::SimConfig arm;
  arm.is_held = !device.is_free;
  arm.hand_file = device.hand;
  arm.seed = twin.seed;
  arm.encoder_error_m = kEncoderErrorMetres;
  arm.serial = twin.serial;
  arm.frame = twin.frame;
  auto made = device_sim::SimDriver::create(std::move(arm));
  if (!made) return unexpected{made.error()};
  return std::unique_ptr<driver::Driver>(std::move(*made));
}

template <class Driver>
Made make_twin(const DeviceSettings& device) {
  return std::unique_ptr<driver::Driver>(std::make_unique<Driver>(twin_of(device)));
}

#if __has_include("rtpm/device_mpv/mpv_driver.hpp")
Made make_mpv(const DeviceSettings& device) {
  const auto settings = device_mpv::read_settings(device.arguments);
  if (!settings) return unexpected{settings.error()};
  const std::string serial = device.serial.empty() ? "mpv-" + device.name : device.serial;
  return std::unique_ptr<driver::Driver>(std::make_unique<device_mpv::MpvDriver>(
      device_mpv::open_mpv(*settings), serial, device.name + "/base"));
}
#endif

#if __has_include("rtpm/device_vrpn/vrpn_driver.hpp")
Made make_vrpn(const DeviceSettings& device) {
  auto settings = device_vrpn::read_settings(device.arguments);
  if (!settings) return unexpected{settings.error()};
  std::string serial = device.serial;
  if (serial.empty()) {
    serial = settings->tracker + "-" + std::to_string(settings->sensor) + "@" + settings->host;
  }
  return std::unique_ptr<driver::Driver>(std::make_unique<device_vrpn::VrpnDriver>(
      std::move(*settings), std::move(serial), device.name + "/base"));
}
#endif

constexpr std::array kDrivers{
    DriverInfo{"arm", "simulated: a haptic arm in a hand", &make_arm, nullptr, ""},
    DriverInfo{"biometric", "simulated: pulse and skin conductance",
               &make_twin<device_sim::BiometricDriver>, nullptr, ""},
    DriverInfo{"gaze", "simulated: a gaze tracker", &make_twin<device_sim::GazeDriver>, nullptr,
               ""},
    DriverInfo{"knob", "simulated: a knob with a motor", &make_twin<device_sim::KnobDriver>,
               nullptr, ""},
    DriverInfo{"player", "simulated: a media player", &make_twin<device_sim::PlayerDriver>, nullptr,
               ""},
    DriverInfo{"stimulus", "simulated: a lamp, a loudspeaker and a hammer, with their sensors",
               &make_twin<device_sim::StimulusDriver>, nullptr, ""},
    DriverInfo{"mpv", "the media player mpv", RTPM_MPV, nullptr, ""},
    DriverInfo{"vrpn", "a tracker of a VRPN server", RTPM_VRPN, nullptr, ""},
    DriverInfo{"evdev", "input devices of Linux, with force feedback", RTPM_EVDEV, "libevdev-dev"},
    DriverInfo{"falcon", "Novint Falcon", RTPM_FALCON, "libusb-1.0-0-dev"},
    DriverInfo{"hid", "3Dconnexion SpaceMouse, game pads, DualShock 4, DualSense, OpenFFBoard",
               RTPM_HID, "libhidapi-dev"},
    DriverInfo{"serial", "microcontroller boards at a serial port", RTPM_SERIAL,
               "libserialport-dev"},
};

const DriverInfo* find(std::string_view name) {
  return std::ranges::find_if(kDrivers, [&](const DriverInfo& info) { return info.name == name; });
}

}  // namespace

std::span<const DriverInfo> drivers() {
  return kDrivers;
}

std::string driver_names() {
  std::string names;
  for (const DriverInfo& info : kDrivers)
    names += std::string(names.empty() ? "" : ", ") + info.name;
  return names;
}

bool is_driver(std::string_view name) {
  return find(name) != kDrivers.end();
}

Made make_driver(const DeviceSettings& device, std::string_view name) {
  if (device.driver.find_first_of("/\\") != std::string::npos || device.driver.ends_with(".so") ||
      device.driver.ends_with(".dll")) {
    return driver_host::load_plugin(device.driver, device.arguments, name);
  }
  const DriverInfo* const info = find(device.driver);
  if (info == kDrivers.end()) {
    return setup_error("there is no driver '" + device.driver + "'", "",
                       "name one of " + driver_names() + ", or the file of a plug-in");
  }
  if (info->make == nullptr) {
    const std::string what = "this build has no driver '" + device.driver + "'";
    if (*info->package == '\0') return setup_error(what, "RTPM has it on Linux only");
    return setup_error(
        what, "its library was not found, or RTPM does not use it on this system",
        std::string("on Linux, install the Debian package ") + info->package + " and build again");
  }
  return info->make(device);
}

}  // namespace rtpm::deviced
