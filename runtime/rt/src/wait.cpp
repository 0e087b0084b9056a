#include "rtpm/rt/wait.hpp"

namespace rtpm::rt {

std::string_view to_string(WaitStrategy strategy) noexcept {
  switch (strategy) {
    case WaitStrategy::kAdaptive:
      return "adaptive";
    case WaitStrategy::kBlock:
      return "block";
    case WaitStrategy::kPeriodic:
      return "periodic";
    case WaitStrategy::kSpin:
      return "spin";
  }
  return "unknown";
}

}  // namespace rtpm::rt
