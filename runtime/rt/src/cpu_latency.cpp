#include "rtpm/rt/cpu_latency.hpp"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <string>
#include <utility>

#include "os/wake_up_limit.hpp"
#include "rtpm/rt/report.hpp"

namespace rtpm::rt {
namespace {

constexpr const char* kSubject = "CPU latency";

}  // namespace

expected<CpuLatencyRequest, SetupError> CpuLatencyRequest::open(Duration latency,
                                                                RealtimeMode mode) {
  CpuLatencyRequest request;
  if (mode == RealtimeMode::kOff) return request;
  const auto us =
      static_cast<std::int32_t>(std::clamp<std::int64_t>(latency.count() / 1000, 0, INT32_MAX));
  const auto limit = os::limit_wake_up(us);
  if (limit) {
    request.file_ = *limit;
    note_setup({kSubject, Grant::kGranted,
                "CPUs wake within " + std::to_string(us) + " µs, as long as this runs", ""});
    return request;
  }
  const SetupError& refusal = limit.error();
  if (mode == RealtimeMode::kRequire) return unexpected{refusal};
  note_setup({kSubject, Grant::kRefused, refusal.what, refusal.remedy});
  static std::atomic<bool> is_told{false};
  if (!is_told.exchange(true)) {
    std::fprintf(stderr, "rtpm: warning: %s\n", refusal.text().c_str());
  }
  return request;
}

CpuLatencyRequest::CpuLatencyRequest(CpuLatencyRequest&& other) noexcept
    : file_(std::exchange(other.file_, -1)) {}

CpuLatencyRequest& CpuLatencyRequest::operator=(CpuLatencyRequest&& other) noexcept {
  std::swap(file_, other.file_);
  return *this;
}

CpuLatencyRequest::~CpuLatencyRequest() {
  if (file_ >= 0) os::end_wake_up_limit(file_);
}

}  // namespace rtpm::rt
