#pragma once

#include <cstdint>

#include "rtpm/base/time.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/lease.hpp"

namespace rtpm::gvd {

/// The record of one cycle of a device.
/// @ownership a value, trivially copyable
struct CycleRecord {
  MonotonicTime time{};                        ///< The cycle's time.
  driver::Sample sample{};                     ///< The published sample.
  std::uint16_t lease_serial = 0;              ///< Differs between consecutive leases.
  bool is_held = false;                        ///< A client holds the lease.
  LeaseState last_end = LeaseState::kUnknown;  ///< Why the previous lease ended.
};

/// Observes every cycle of a device.
/// @threads  on_cycle() runs on the device's thread
class CycleObserver {
 public:
  CycleObserver() = default;
  CycleObserver(const CycleObserver&) = delete;
  CycleObserver& operator=(const CycleObserver&) = delete;
  virtual ~CycleObserver() = default;
  /// @realtime must be alloc-free, without waiting and without a system call
  virtual void on_cycle(const CycleRecord& record) noexcept = 0;
};

}  // namespace rtpm::gvd
