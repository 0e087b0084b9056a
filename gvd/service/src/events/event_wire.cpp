#include "events/event_wire.hpp"

#include <device_events.rtpm.events.hpp>

#include <utility>

#include "rtpm/gvd/models_wire.hpp"
#include "rtpm/gvd/wire.hpp"

namespace rtpm::gvd {
namespace {

static_assert(kSampled == device::SampledEvent::kType &&
              kButtonChanged == device::ButtonChangedEvent::kType &&
              kContactChanged == device::ContactChangedEvent::kType &&
              kLifecycleChanged == device::LifecycleChangedEvent::kType &&
              kFaultChanged == device::FaultChangedEvent::kType &&
              kLeaseChanged == device::LeaseChangedEvent::kType &&
              kStopChanged == device::StopChangedEvent::kType &&
              kConfigurationChanged == device::ConfigurationChangedEvent::kType &&
              kModelsRendered == device::ModelsRenderedEvent::kType);

template <class Event>
expected<void, rpc::CallError> add(events::Supplier& supplier, const EventStamp& stamp,
                                   ConstBytes payload) noexcept {
  return supplier.add({.type = Event::kType,
                       .source = stamp.source,
                       .schema_id = Event::kSchemaId,
                       .payload = payload,
                       .origin = stamp.time});
}

/// A visitor that adds a change to the batch.
struct Adder {
  events::Supplier& supplier;
  const EventStamp& stamp;

  template <class Event>
  expected<void, rpc::CallError> put(const typename Event::Payload& payload) const noexcept {
    return add<Event>(supplier, stamp, rpc::struct_bytes(payload));
  }
  expected<void, rpc::CallError> operator()(const ButtonChange& change) const noexcept {
    return put<device::ButtonChangedEvent>(
        {stamp.cycle, static_cast<std::uint8_t>(change.button), change.is_pressed});
  }
  expected<void, rpc::CallError> operator()(const ContactChange& change) const noexcept {
    return put<device::ContactChangedEvent>({stamp.cycle, change.force_newton, change.is_touching});
  }
  expected<void, rpc::CallError> operator()(const LifecycleChange& change) const noexcept {
    return put<device::LifecycleChangedEvent>({stamp.cycle,
                                               static_cast<std::uint8_t>(change.before),
                                               static_cast<std::uint8_t>(change.after)});
  }
  expected<void, rpc::CallError> operator()(const FaultChange& change) const noexcept {
    return put<device::FaultChangedEvent>({stamp.cycle, change.begun.bits(), change.ended.bits()});
  }
  expected<void, rpc::CallError> operator()(const LeaseChange& change) const noexcept {
    return put<device::LeaseChangedEvent>({stamp.cycle, static_cast<std::uint8_t>(change.state)});
  }
  expected<void, rpc::CallError> operator()(const StopChange& change) const noexcept {
    return put<device::StopChangedEvent>({stamp.cycle, change.is_stopped});
  }
};

/// The payload of an event; null unless it has the type and version of `Event`.
template <class Event>
const typename Event::Payload* payload_of(const events::EventView& event) noexcept {
  using Payload = typename Event::Payload;
  if (event.header.type != Event::kType || event.header.schema_id != Event::kSchemaId) {
    return nullptr;
  }
  if constexpr (Event::kIsStruct) {
    return event.payload.size() == sizeof(Payload) ? &rpc::view_struct<Payload>(event.payload)
                                                   : nullptr;
  } else {
    if (!rpc::is_valid_table<Payload>(event.payload, Event::kLimits)) return nullptr;
    return flatbuffers::GetRoot<Payload>(event.payload.data());
  }
}

/// An unknown number, from a later version, is read as the least harmful value.
driver::Lifecycle lifecycle_of(std::uint8_t number) noexcept {
  return number < driver::kLifecycleCount ? static_cast<driver::Lifecycle>(number)
                                          : driver::Lifecycle::kFault;
}
LeaseState lease_state_of(std::uint8_t number) noexcept {
  return number < kLeaseStateCount ? static_cast<LeaseState>(number) : LeaseState::kUnknown;
}

/// Reads a payload into `to` if the event is of its type.
template <class Event, class Read>
bool read_as(const events::EventView& event, DeviceEvent& to, Read read) {
  const auto* const payload = payload_of<Event>(event);
  if (payload == nullptr) return false;
  if constexpr (Event::kIsStruct) to.cycle = payload->cycle();
  to.what = read(*payload);
  return true;
}

ConfigurationChange configuration_of(const device::ConfigurationChanged& wire) {
  ConfigurationChange change{.revision = wire.revision()};
  for (const flatbuffers::String* name : *wire.names())
    change.names.push_back(name->str());
  return change;
}

bool read_sample(const events::EventView& event, DeviceEvent& to) {
  const auto* const payload = payload_of<device::SampledEvent>(event);
  if (payload == nullptr) return false;
  to.cycle = payload->sequence();
  to.what = from_wire(*payload);
  return true;
}

bool read_configuration(const events::EventView& event, DeviceEvent& to) {
  const auto* const payload = payload_of<device::ConfigurationChangedEvent>(event);
  if (payload == nullptr) return false;
  to.what = configuration_of(*payload);
  return true;
}

bool read_models(const events::EventView& event, DeviceEvent& to) {
  if (event.header.type != kModelsRendered) return false;
  const auto list = models_of(event.header.schema_id, event.payload);
  if (!list) return false;
  to.cycle = flatbuffers::GetRoot<device::ModelsRendered>(event.payload.data())->cycle();
  to.what = ModelsChange{{list->models().begin(), list->models().end()}};
  return true;
}

bool read_change(const events::EventView& event, DeviceEvent& to) {
  return read_as<device::ButtonChangedEvent>(
             event, to,
             [](const auto& wire) {
               return ButtonChange{wire.button(), wire.is_pressed()};
             }) ||
         read_as<device::ContactChangedEvent>(
             event, to,
             [](const auto& wire) {
               return ContactChange{wire.is_touching(), wire.force_newton()};
             }) ||
         read_as<device::LifecycleChangedEvent>(
             event, to,
             [](const auto& wire) {
               return LifecycleChange{lifecycle_of(wire.before()), lifecycle_of(wire.after())};
             }) ||
         read_as<device::FaultChangedEvent>(
             event, to,
             [](const auto& wire) {
               return FaultChange{driver::Faults{wire.begun()}, driver::Faults{wire.ended()}};
             }) ||
         read_as<device::LeaseChangedEvent>(
             event, to,
             [](const auto& wire) { return LeaseChange{lease_state_of(wire.state())}; }) ||
         read_as<device::StopChangedEvent>(
             event, to, [](const auto& wire) { return StopChange{wire.is_stopped()}; });
}

}  // namespace

std::vector<const events::EventDescriptor*> device_event_types() {
  return {
      &device::SampledEvent::kDescriptor,        &device::ButtonChangedEvent::kDescriptor,
      &device::ContactChangedEvent::kDescriptor, &device::LifecycleChangedEvent::kDescriptor,
      &device::FaultChangedEvent::kDescriptor,   &device::LeaseChangedEvent::kDescriptor,
      &device::StopChangedEvent::kDescriptor,    &device::ConfigurationChangedEvent::kDescriptor,
      &device::ModelsRenderedEvent::kDescriptor};
}

const events::EventDescriptor* device_event_type(events::EventType type) {
  const auto types = device_event_types();
  const auto found = std::ranges::find(types, type, &events::EventDescriptor::type);
  return found == types.end() ? nullptr : *found;
}

expected<void, rpc::CallError> add_event(events::Supplier& supplier, const EventStamp& stamp,
                                         const driver::Sample& sample) noexcept {
  const device::Sample wire = to_wire(sample);
  return add<device::SampledEvent>(supplier, stamp, rpc::struct_bytes(wire));
}

expected<void, rpc::CallError> add_event(events::Supplier& supplier, const EventStamp& stamp,
                                         const CycleChange& change) noexcept {
  return std::visit(Adder{supplier, stamp}, change);
}

expected<void, rpc::CallError> add_event(events::Supplier& supplier, const EventStamp& stamp,
                                         const ConfigurationChange& change) {
  flatbuffers::FlatBufferBuilder builder;
  const auto names = builder.CreateVectorOfStrings(change.names);
  builder.Finish(device::CreateConfigurationChanged(builder, change.revision, names));
  return add<device::ConfigurationChangedEvent>(supplier, stamp, rpc::table_bytes(builder));
}

expected<void, rpc::CallError> add_event(events::Supplier& supplier, const EventStamp& stamp,
                                         const ModelList& models) {
  device::ModelsRenderedT wire;
  wire.cycle = stamp.cycle;
  wire.models = to_wire(models.models());
  flatbuffers::FlatBufferBuilder builder;
  builder.Finish(device::CreateModelsRendered(builder, &wire));
  return add<device::ModelsRenderedEvent>(supplier, stamp, rpc::table_bytes(builder));
}

std::optional<DeviceEvent> read_event(const events::EventView& event) {
  DeviceEvent read;
  read.header = event.header;
  if (event.header.type == events::kTimeoutType) {
    read.what = Timeout{event.header.source};
    return read;
  }
  if (read_sample(event, read) || read_change(event, read) || read_configuration(event, read) ||
      read_models(event, read)) {
    return read;
  }
  return std::nullopt;
}

}  // namespace rtpm::gvd
