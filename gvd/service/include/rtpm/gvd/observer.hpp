#pragma once

#include <cstdint>

#include "rtpm/base/time.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/lease.hpp"
#include "rtpm/models/model.hpp"

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

/// The local models that a device renders from a cycle on.
/// @ownership a value, trivially copyable
struct ModelsRecord {
  MonotonicTime time{};     ///< The cycle's time.
  std::uint64_t cycle = 0;  ///< Its Sample::sequence.
  ModelList list{};         ///< Empty: the models have ended.
};

/// Observes every cycle of a device.
/// @threads  all run on the device's thread
class CycleObserver {
 public:
  CycleObserver() = default;
  CycleObserver(const CycleObserver&) = delete;
  CycleObserver& operator=(const CycleObserver&) = delete;
  virtual ~CycleObserver() = default;
  /// @realtime must be alloc-free, without waiting and without a system call
  virtual void on_cycle(const CycleRecord& record) noexcept = 0;
  /// A new list of models, after on_cycle() of its first cycle.
  /// @realtime as on_cycle()
  virtual void on_models(const ModelsRecord& /*record*/) noexcept {}
};

}  // namespace rtpm::gvd
