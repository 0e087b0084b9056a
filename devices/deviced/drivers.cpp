#include "drivers.hpp"

#include <algorithm>

#include "rtpm/device_mpv/mpv_driver.hpp"
#include "rtpm/device_mpv/settings.hpp"
#include "rtpm/device_sim/biometric_driver.hpp"
#include "rtpm/device_sim/gaze_driver.hpp"
#include "rtpm/device_sim/knob_driver.hpp"
#include "rtpm/device_sim/player_driver.hpp"
#include "rtpm/device_sim/sim_driver.hpp"
#include "rtpm/driver_host/plugin.hpp"

namespace rtpm::deviced {
namespace {

using Made = expected<std::unique_ptr<driver::Driver>, SetupError>;

/// As of a real arm that was not calibrated.
constexpr double kEncoderErrorMetres = 1e-3;

Made make_arm(const DeviceSettings& device, const device_sim::TwinConfig& twin) {
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
Made make_twin(const DeviceSettings&, const device_sim::TwinConfig& twin) {
  return std::unique_ptr<driver::Driver>(std::make_unique<Driver>(twin));
}

Made make_mpv(const DeviceSettings& device, const device_sim::TwinConfig& twin) {
  const auto settings = device_mpv::read_settings(device.arguments);
  if (!settings) return unexpected{settings.error()};
  const std::string serial = device.serial.empty() ? "mpv-" + device.name : device.serial;
  return std::unique_ptr<driver::Driver>(
      std::make_unique<device_mpv::MpvDriver>(device_mpv::open_mpv(*settings), serial, twin.frame));
}

struct Simulated {
  const char* name;
  Made (*make)(const DeviceSettings&, const device_sim::TwinConfig&);
};
constexpr std::array kSimulated{
    Simulated{"arm", &make_arm},
    Simulated{"biometric", &make_twin<device_sim::BiometricDriver>},
    Simulated{"gaze", &make_twin<device_sim::GazeDriver>},
    Simulated{"knob", &make_twin<device_sim::KnobDriver>},
    Simulated{"mpv", &make_mpv},
    Simulated{"player", &make_twin<device_sim::PlayerDriver>},
};

}  // namespace

const std::vector<std::string>& simulated_drivers() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> found;
    for (const Simulated& simulated : kSimulated)
      found.emplace_back(simulated.name);
    return found;
  }();
  return names;
}

Made make_driver(const DeviceSettings& device) {
  if (device.driver.find('/') != std::string::npos || device.driver.ends_with(".so")) {
    return driver_host::load_plugin(device.driver, device.arguments);
  }
  const auto* const simulated = std::ranges::find(kSimulated, device.driver, &Simulated::name);
  if (simulated == kSimulated.end()) {
    std::string names;
    for (const std::string& name : simulated_drivers())
      names += (names.empty() ? "" : ", ") + name;
    return setup_error("there is no driver '" + device.driver + "'", "",
                       "name one of " + names + ", or the file of a plug-in");
  }
  device_sim::TwinConfig twin;
  twin.serial = device.serial.empty() ? "sim-" + device.name : device.serial;
  twin.frame = device.name + "/base";
  twin.seed = device.seed;
  return simulated->make(device, twin);
}

}  // namespace rtpm::deviced
