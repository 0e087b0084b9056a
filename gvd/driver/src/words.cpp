#include <array>
#include <string>
#include <utility>

#include "rtpm/driver/driver.hpp"

namespace rtpm::driver {

std::string_view to_string(Lifecycle lifecycle) noexcept {
  switch (lifecycle) {
    case Lifecycle::kUnconfigured:
      return "unconfigured";
    case Lifecycle::kInactive:
      return "inactive";
    case Lifecycle::kActive:
      return "active";
    case Lifecycle::kFault:
      return "fault";
    case Lifecycle::kFinalized:
      return "finalized";
  }
  return "unknown";
}

std::string_view to_string(DeviceClass device_class) noexcept {
  switch (device_class) {
    case DeviceClass::kHaptic:
      return "haptic";
    case DeviceClass::kTracker:
      return "tracker";
    case DeviceClass::kInput:
      return "input";
    case DeviceClass::kDial:
      return "dial";
    case DeviceClass::kVibrotactile:
      return "vibrotactile";
    case DeviceClass::kPoser:
      return "poser";
    case DeviceClass::kOutput:
      return "output";
    case DeviceClass::kPlayer:
      return "player";
    case DeviceClass::kBiometric:
      return "biometric";
  }
  return "unknown";
}

std::string_view to_string(CommandMode mode) noexcept {
  switch (mode) {
    case CommandMode::kOff:
      return "off";
    case CommandMode::kForce:
      return "force";
    case CommandMode::kPose:
      return "pose";
    case CommandMode::kVelocity:
      return "velocity";
    case CommandMode::kJointPosition:
      return "joint position";
    case CommandMode::kJointVelocity:
      return "joint velocity";
    case CommandMode::kJointEffort:
      return "joint effort";
    case CommandMode::kOutputs:
      return "outputs";
  }
  return "unknown";
}

std::string_view to_string(ExchangeStatus status) noexcept {
  switch (status) {
    case ExchangeStatus::kOk:
      return "ok";
    case ExchangeStatus::kLate:
      return "late";
    case ExchangeStatus::kCorrupt:
      return "corrupt";
    case ExchangeStatus::kGone:
      return "gone";
  }
  return "unknown";
}

std::string to_text(Faults faults) {
  static constexpr std::array kWords{
      std::pair{Fault::kDeviceLate, "device late"},
      std::pair{Fault::kDeviceCorrupt, "device data corrupt"},
      std::pair{Fault::kDeviceGone, "device gone"},
      std::pair{Fault::kDeviceSaturated, "actuators saturated"},
      std::pair{Fault::kOutsideWorkspace, "outside the workspace"},
      std::pair{Fault::kCommandNotFinite, "command not finite"},
      std::pair{Fault::kCommandLost, "command lost"},
      std::pair{Fault::kForceClamped, "force clamped"},
      std::pair{Fault::kForceRateLimited, "force rate limited"},
      std::pair{Fault::kSoftStart, "soft start"},
      std::pair{Fault::kEmergencyStop, "emergency stop"},
      std::pair{Fault::kTooFast, "too fast"},
      std::pair{Fault::kSoftWall, "pushed back into the workspace"},
      std::pair{Fault::kPowerLimited, "power limited"},
      std::pair{Fault::kBraked, "braked"},
      std::pair{Fault::kHeatLimited, "heat limited"},
      std::pair{Fault::kImplausible, "implausible pose or time"},
  };
  std::string text;
  for (const auto& [fault, words] : kWords) {
    if (!faults.has(fault)) continue;
    if (!text.empty()) text += ", ";
    text += words;
  }
  return text.empty() ? "none" : text;
}

}  // namespace rtpm::driver
