#include "rtpm/rt/cpu_latency.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>
#include <utility>

#include "rtpm/rt/report.hpp"

namespace rtpm::rt {
namespace {

constexpr const char* kSubject = "CPU latency";
constexpr const char* kRemedy =
    "give the user write access to /dev/cpu_dma_latency (a udev rule, or run as root), or say "
    "--cpu-latency off.";

}  // namespace

expected<CpuLatencyRequest, SetupError> CpuLatencyRequest::open(Duration latency,
                                                                RealtimeMode mode) {
  CpuLatencyRequest request;
  if (mode == RealtimeMode::kOff) return request;
  request.file_ = ::open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC);
  int error = request.file_ < 0 ? errno : 0;
  const auto us =
      static_cast<std::int32_t>(std::clamp<std::int64_t>(latency.count() / 1000, 0, INT32_MAX));
  if (error == 0 && write(request.file_, &us, sizeof us) != sizeof us) error = errno;
  if (error == 0) {
    note_setup({kSubject, Grant::kGranted,
                "CPUs wake within " + std::to_string(us) + " µs, as long as this runs", ""});
    return request;
  }
  const std::error_code cause = system_error(error);
  const SetupError refusal{"CPUs can't be kept from deep sleep (/dev/cpu_dma_latency: " +
                               cause.message() + "): waking may take longer",
                           {},
                           kRemedy,
                           cause};
  if (mode == RealtimeMode::kRequire) return unexpected{refusal};
  note_setup({kSubject, Grant::kRefused, refusal.what, kRemedy});
  static std::atomic<bool> is_told{false};
  if (!is_told.exchange(true)) {
    std::fprintf(stderr, "rtpm: warning: %s\n", refusal.text().c_str());
  }
  return CpuLatencyRequest{};
}

CpuLatencyRequest::CpuLatencyRequest(CpuLatencyRequest&& other) noexcept
    : file_(std::exchange(other.file_, -1)) {}

CpuLatencyRequest& CpuLatencyRequest::operator=(CpuLatencyRequest&& other) noexcept {
  std::swap(file_, other.file_);
  return *this;
}

CpuLatencyRequest::~CpuLatencyRequest() {
  if (file_ >= 0) close(file_);
}

}  // namespace rtpm::rt
