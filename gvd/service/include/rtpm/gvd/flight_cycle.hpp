#pragma once

#include <array>
#include <cstddef>

#include "rtpm/events/scalar.hpp"
#include "rtpm/safety/flight_recorder.hpp"

/// Cycles of flight records as messages in recordings.
namespace rtpm::gvd {

/// Bytes of the struct FlightRecord of device.fbs.
inline constexpr std::size_t kFlightCycleSize = 192;

/// The message type: rtpm.device.FlightCycle, with its schema.
[[nodiscard]] const events::EventDescriptor& flight_cycle_type() noexcept;
/// @realtime alloc-free
[[nodiscard]] std::array<std::byte, kFlightCycleSize> flight_cycle_payload(
    const FlightRecord& record) noexcept;

}  // namespace rtpm::gvd
