#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "events/change_finder.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/events/scalar.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/gvd/device_event.hpp"

/// Converts device events between memory and schema.
namespace rtpm::gvd {

/// Source, cycle and time of a device event.
struct EventStamp {
  events::SourceId source = 0;
  std::uint64_t cycle = 0;
  MonotonicTime time{};
};

/// All types of device events, for filters on their fields.
[[nodiscard]] std::vector<const events::EventDescriptor*> device_event_types();

/// Adds an event to the batch of `supplier`.
/// @errors   those of events::Supplier::add()
[[nodiscard]] expected<void, rpc::CallError> add_event(events::Supplier& supplier,
                                                       const EventStamp& stamp,
                                                       const driver::Sample& sample) noexcept;
[[nodiscard]] expected<void, rpc::CallError> add_event(events::Supplier& supplier,
                                                       const EventStamp& stamp,
                                                       const CycleChange& change) noexcept;
[[nodiscard]] expected<void, rpc::CallError> add_event(events::Supplier& supplier,
                                                       const EventStamp& stamp,
                                                       const ConfigurationChange& change);
[[nodiscard]] expected<void, rpc::CallError> add_event(events::Supplier& supplier,
                                                       const EventStamp& stamp,
                                                       const ModelList& models);

/// Reads an event, except its `device`; nullopt if it is of another type or version, or malformed.
[[nodiscard]] std::optional<DeviceEvent> read_event(const events::EventView& event);

}  // namespace rtpm::gvd
