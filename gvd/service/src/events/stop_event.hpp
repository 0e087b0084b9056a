#pragma once

#include <device_events.rtpm.events.hpp>

#include <cstdint>

#include "rtpm/events/supplier.hpp"
#include "rtpm/gvd/system_stop.hpp"
#include "rtpm/rt/host.hpp"

namespace rtpm::gvd {

static_assert(kStopAllRequested == device::StopAllRequestedEvent::kType);

/// The id that means no request.
inline constexpr std::uint64_t kNoStopRequest = 0;

[[nodiscard]] inline std::uint64_t random_stop_id() noexcept {
  std::uint64_t id = kNoStopRequest;
  while (id == kNoStopRequest)
    id = rt::random_u64();
  return id;
}

/// Asks all servers at the supplier's hub to stop their devices.
[[nodiscard]] inline expected<void, rpc::CallError> push_stop(events::Supplier& to,
                                                              std::uint64_t id) noexcept {
  const device::StopAll stop{id};
  return to.push({.type = kStopAllRequested,
                  .source = kStopAllSource,
                  .schema_id = device::StopAllRequestedEvent::kSchemaId,
                  .payload = rpc::struct_bytes(stop)});
}

}  // namespace rtpm::gvd
