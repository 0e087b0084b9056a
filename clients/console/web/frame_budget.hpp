#pragma once

#include <algorithm>
#include <cstddef>

#include "rtpm/base/time.hpp"

namespace rtpm::console {

/// Limits the rate at which frames of a client without the token are read, so that they leave the
/// web server's thread enough time for other work.
/// @threads  one
class FrameBudget {
 public:
  /// The sustained rate; a frame counts as `kFrameCost` bytes more than its size.
  static constexpr double kBytesPerSecond = 256.0 * 1024;
  static constexpr std::size_t kFrameCost = 1024;
  /// The length of a burst beyond the sustained rate.
  static constexpr Duration kBurst = std::chrono::milliseconds{500};

  /// Takes a frame of `size` bytes into account.
  /// @return the time that the next frame has to wait
  [[nodiscard]] Duration take(std::size_t size, MonotonicTime now) noexcept {
    const double seconds = static_cast<double>(size + kFrameCost) / kBytesPerSecond;
    paid_until_ = std::max(paid_until_, now) + Duration{static_cast<Duration::rep>(seconds * 1e9)};
    return std::max(Duration{0}, paid_until_ - now - kBurst);
  }

 private:
  MonotonicTime paid_until_ = MonotonicTime::min();
};

}  // namespace rtpm::console
