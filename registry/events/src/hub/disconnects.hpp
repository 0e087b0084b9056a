#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "rtpm/events/hub.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::events {

/// The most recent disconnects, and counts by reason.
/// @threads  any
class Disconnects {
 public:
  /// Records a disconnect, and swaps the name in.
  /// @realtime alloc-free; `name` receives the evicted one, for the caller to free
  void note(std::string& name, DisconnectReason reason, MonotonicTime now) noexcept;
  [[nodiscard]] std::vector<Disconnect> after(std::uint64_t number) const;
  [[nodiscard]] DisconnectCounters counters() const noexcept;

 private:
  mutable rt::PiMutex mutex_;
  std::array<Disconnect, kDisconnectCountMax> last_{};
  std::uint64_t count_ = 0;
  DisconnectCounters counters_{};
};

}  // namespace rtpm::events
