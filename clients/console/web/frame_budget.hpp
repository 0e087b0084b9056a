#pragma once

#include <algorithm>
#include <cstddef>

#include "rtpm/base/time.hpp"

namespace rtpm::console {

/// Limits how fast frames of a client without the token are read, so that the web server's thread
/// has enough time for other work.
/// @threads  one
class FrameBudget {
 public:
  /// The sustained rate; each frame costs `kFrameCost` bytes in addition to its size.
  static constexpr double kBytesPerSecond = 256.0 * 1024;
  static constexpr std::size_t kFrameCost = 1024;
  /// The length of a burst beyond the sustained rate.
  static constexpr Duration kBurst = std::chrono::milliseconds{500};

  /// Accounts for a frame of `size` bytes.
  /// @return how long the next frame has to wait
  [[nodiscard]] Duration take(std::size_t size, MonotonicTime now) noexcept {
    const double seconds = static_cast<double>(size + kFrameCost) / kBytesPerSecond;
    paid_until_ = std::max(paid_until_, now) + Duration{static_cast<Duration::rep>(seconds * 1e9)};
    return std::max(Duration{0}, paid_until_ - now - kBurst);
  }

 private:
  MonotonicTime paid_until_ = MonotonicTime::min();
};

}  // namespace rtpm::console
