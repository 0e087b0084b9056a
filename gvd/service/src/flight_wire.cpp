#include "flight_wire.hpp"

#include <cstring>
#include <device_events.rtpm.events.hpp>
#include <vector>

#include "rtpm/gvd/flight_cycle.hpp"
#include "rtpm/gvd/wire.hpp"

namespace rtpm::gvd {
namespace {

device::FlightRecord wire_of(const FlightRecord& record) {
  return {record.cycle,
          record.time.time_since_epoch().count(),
          to_wire(record.position_m),
          to_wire(record.velocity_m_per_s),
          to_wire(record.received.force_newton),
          to_wire(record.received.torque_newton_metre),
          to_wire(record.applied.force_newton),
          to_wire(record.applied.torque_newton_metre),
          record.gain,
          record.energy_joule,
          record.heat,
          record.faults.bits(),
          record.has_command};
}

FlightRecord record_of(const device::FlightRecord& wire) {
  FlightRecord record;
  record.cycle = wire.cycle();
  record.time = MonotonicTime{Duration{wire.time_ns()}};
  record.position_m = from_wire(wire.position_m());
  record.velocity_m_per_s = from_wire(wire.linear_m_per_s());
  record.received = {from_wire(wire.received_newton()), from_wire(wire.received_newton_metre())};
  record.applied = {from_wire(wire.applied_newton()), from_wire(wire.applied_newton_metre())};
  record.gain = wire.gain();
  record.energy_joule = wire.energy_joule();
  record.heat = wire.heat();
  record.faults = driver::Faults{wire.faults()};
  record.has_command = wire.has_command();
  return record;
}

}  // namespace

const events::EventDescriptor& flight_cycle_type() noexcept {
  return device::FlightCycleEvent::kDescriptor;
}

std::array<std::byte, kFlightCycleSize> flight_cycle_payload(const FlightRecord& record) noexcept {
  static_assert(sizeof(device::FlightRecord) == kFlightCycleSize);
  const device::FlightRecord wire = wire_of(record);
  std::array<std::byte, kFlightCycleSize> bytes{};
  std::memcpy(bytes.data(), &wire, sizeof wire);
  return bytes;
}

flatbuffers::Offset<device::FlightRecordReply> to_wire(const FlightLog& log,
                                                       flatbuffers::FlatBufferBuilder& builder) {
  std::vector<device::FlightRecord> cycles;
  cycles.reserve(log.records.size());
  for (const FlightRecord& record : log.records)
    cycles.push_back(wire_of(record));
  const auto cycles_at = builder.CreateVectorOfStructs(cycles);
  return device::CreateFlightRecordReply(builder, log.number,
                                         static_cast<device::FlightCause>(log.cause), log.cycle,
                                         static_cast<std::uint32_t>(log.record_count), cycles_at);
}

void add_from_wire(const device::FlightRecordReply& wire, FlightLog& log) {
  log.number = wire.number();
  log.cause = static_cast<FlightCause>(wire.cause());
  log.cycle = wire.cycle();
  log.record_count = wire.cycle_count();
  for (const device::FlightRecord* const cycle : *wire.cycles())
    log.records.push_back(record_of(*cycle));
}

}  // namespace rtpm::gvd
