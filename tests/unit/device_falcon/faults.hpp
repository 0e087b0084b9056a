#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "falcon_model.hpp"

namespace rtpm::test {

[[nodiscard]] inline const char* to_string(FalconFault fault) {
  switch (fault) {
    case FalconFault::kNone:
      return "None";
    case FalconFault::kNoAnswer:
      return "NoAnswer";
    case FalconFault::kLate:
      return "Late";
    case FalconFault::kShort:
      return "Short";
    case FalconFault::kSplit:
      return "Split";
    case FalconFault::kGlued:
      return "Glued";
    case FalconFault::kFlippedByte:
      return "FlippedByte";
    case FalconFault::kNoStartMark:
      return "NoStartMark";
    case FalconFault::kNoEndMark:
      return "NoEndMark";
    case FalconFault::kWrongEcho:
      return "WrongEcho";
    case FalconFault::kStatusOnly:
      return "StatusOnly";
    case FalconFault::kStall:
      return "Stall";
    case FalconFault::kOverflow:
      return "Overflow";
    case FalconFault::kNoDevice:
      return "NoDevice";
    case FalconFault::kEncoderJump:
      return "EncoderJump";
    case FalconFault::kHomedBitLost:
      return "HomedBitLost";
    case FalconFault::kStuckButton:
      return "StuckButton";
    case FalconFault::kTorqueIgnored:
      return "TorqueIgnored";
  }
  return "?";
}

/// A fault at a step of the protocol.
struct FaultAtStep {
  FalconFault fault;
  FalconStep step;
};

inline std::string name_of(const FaultAtStep& test) {
  static constexpr const char* kSteps[]{"Request", "Greeting", "Prompt", "Firmware", "Packet"};
  return std::string(to_string(test.fault)) + "At" + kSteps[static_cast<std::size_t>(test.step)];
}
inline std::ostream& operator<<(std::ostream& out, const FaultAtStep& test) {
  return out << name_of(test);
}

[[nodiscard]] inline std::vector<FaultAtStep> every_fault_at_every_step() {
  std::vector<FaultAtStep> all;
  for (int fault = 0; fault <= static_cast<int>(kLastFalconFault); ++fault) {
    for (int step = 0; step <= static_cast<int>(kLastFalconStep); ++step) {
      all.push_back({static_cast<FalconFault>(fault), static_cast<FalconStep>(step)});
    }
  }
  return all;
}

[[nodiscard]] inline std::vector<FalconFault> all_faults() {
  std::vector<FalconFault> all;
  for (int fault = 0; fault <= static_cast<int>(kLastFalconFault); ++fault)
    all.push_back(static_cast<FalconFault>(fault));
  return all;
}

}  // namespace rtpm::test
