#include "rtpm/configuration/error.hpp"

namespace rtpm::gvd {

std::string_view to_string(ConfigurationOutcome outcome) noexcept {
  switch (outcome) {
    case ConfigurationOutcome::kDone:
      return "done";
    case ConfigurationOutcome::kUnknownParameter:
      return "unknown parameter";
    case ConfigurationOutcome::kWrongType:
      return "wrong type";
    case ConfigurationOutcome::kOutOfRange:
      return "out of range";
    case ConfigurationOutcome::kReadOnly:
      return "read-only";
    case ConfigurationOutcome::kWrongState:
      return "wrong state";
    case ConfigurationOutcome::kRepeatedParameter:
      return "repeated parameter";
    case ConfigurationOutcome::kStaleRevision:
      return "stale revision";
    case ConfigurationOutcome::kBusy:
      return "busy";
    case ConfigurationOutcome::kRefusedByDevice:
      return "refused by the device";
    case ConfigurationOutcome::kNotPersistent:
      return "not persistent";
    case ConfigurationOutcome::kStorageFailed:
      return "storage failed";
    case ConfigurationOutcome::kUnknownCalibration:
      return "unknown calibration";
    case ConfigurationOutcome::kNoSuchRun:
      return "no such run";
    case ConfigurationOutcome::kWrongAnswer:
      return "wrong answer";
    case ConfigurationOutcome::kNoResult:
      return "no result";
    case ConfigurationOutcome::kCallFailed:
      return "call failed";
  }
  return "unknown";
}

}  // namespace rtpm::gvd
