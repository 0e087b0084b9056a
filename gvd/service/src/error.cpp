#include "rtpm/gvd/error.hpp"

namespace rtpm::gvd {

std::string_view to_string(const DeviceError& error) noexcept {
  switch (error.outcome()) {
    case DeviceOutcome::kDone:
      return "done";
    case DeviceOutcome::kNotHolder:
      return "this client does not hold the device's lease; acquire it first";
    case DeviceOutcome::kHeld:
      return "another client holds the device's lease; wait until it ends, or take it over";
    case DeviceOutcome::kTooSoon:
      return "the device's lease has changed a moment ago; try again in a second";
    case DeviceOutcome::kBelowOperatorPriority:
      return "the call's priority is below the device's operator priority; raise it";
    case DeviceOutcome::kNotActive:
      return "the device is not active; activate it, or wait until it is back";
    case DeviceOutcome::kSuperseded:
      return "a newer command of this client came first";
    case DeviceOutcome::kNotFinite:
      return "the command has a number that is not finite; correct it, then recover the device";
    case DeviceOutcome::kTooMany:
      return "too many commands at once; send them from fewer threads";
    case DeviceOutcome::kWrongMode:
      return "the device does not take commands of this mode; its description lists those it takes";
    case DeviceOutcome::kEmergencyStop:
      return "an emergency stop is in force; remove its cause, then rearm the device";
    case DeviceOutcome::kOutOfRange:
      return "a number is outside of its range; choose one within";
    case DeviceOutcome::kNotInSystem:
      return "the device's server takes no part in the system-wide stop; its own devices are "
             "stopped, so stop the others one by one";
    case DeviceOutcome::kNoSample:
      return "the device has taken no sample yet; read again";
    case DeviceOutcome::kCallFailed:
      return rpc::to_string(error.call());
  }
  return "the device's answer is of a later version; update this program";
}

}  // namespace rtpm::gvd
