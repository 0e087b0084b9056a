#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "rtpm/events/hub.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::events {

/// The last subscriptions that ended, and how many did for each reason.   Threads: any.
class Departures {
 public:
  /// Takes the name.   RT: alloc-free; frees the name that it forgets.
  void note(std::string& name, DepartureReason reason, MonotonicTime now) noexcept;
  [[nodiscard]] std::vector<Departure> after(std::uint64_t number) const;
  [[nodiscard]] DepartureCounters counters() const noexcept;

 private:
  mutable rt::PiMutex mutex_;
  std::array<Departure, kDepartureCountMax> last_{};
  std::uint64_t count_ = 0;
  DepartureCounters counters_{};
};

}  // namespace rtpm::events
