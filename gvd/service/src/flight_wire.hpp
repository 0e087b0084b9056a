#pragma once

#include <cstddef>
#include <device.rtpm.hpp>

#include "rtpm/safety/flight_recorder.hpp"

namespace rtpm::gvd {

/// Cycles per reply, so that it stays small.
inline constexpr std::size_t kFlightPageSize = 64;

/// @realtime allocates only in `builder`
[[nodiscard]] flatbuffers::Offset<device::FlightRecordReply> to_wire(
    const FlightLog& log, flatbuffers::FlatBufferBuilder& builder);
/// Adds a reply's records to `log`.
/// @realtime set-up only
void add_from_wire(const device::FlightRecordReply& wire, FlightLog& log);

}  // namespace rtpm::gvd
