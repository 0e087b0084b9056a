#include "rtpm/rt/cpu_latency.hpp"

#include <utility>

#include "rtpm/rt/report.hpp"

namespace rtpm::rt {

expected<CpuLatencyRequest, SetupError> CpuLatencyRequest::open(Duration, RealtimeMode mode) {
  if (mode == RealtimeMode::kOff) return CpuLatencyRequest{};
  const SetupError refusal{"CPUs can't be kept from deep sleep: this system has no such right",
                           {},
                           "say --cpu-latency off.",
                           {}};
  if (mode == RealtimeMode::kRequire) return unexpected{refusal};
  note_setup({"CPU latency", Grant::kRefused, refusal.what, refusal.remedy});
  return CpuLatencyRequest{};
}

CpuLatencyRequest::CpuLatencyRequest(CpuLatencyRequest&& other) noexcept
    : file_(std::exchange(other.file_, -1)) {}

CpuLatencyRequest& CpuLatencyRequest::operator=(CpuLatencyRequest&& other) noexcept {
  std::swap(file_, other.file_);
  return *this;
}

CpuLatencyRequest::~CpuLatencyRequest() = default;

}  // namespace rtpm::rt
