#include "event_player.hpp"

#include <algorithm>
#include <device_events.rtpm.events.hpp>
#include <span>
#include <utility>

#include "rtpm/gvd/device_event.hpp"

namespace rtpm::replay {
namespace {

/// This program's descriptor of a device's event; null if `type` is not a device's event.
const events::EventDescriptor* own_type(events::EventType type) {
  static constexpr const events::EventDescriptor* kTypes[] = {
      &device::SampledEvent::kDescriptor,        &device::ButtonChangedEvent::kDescriptor,
      &device::ContactChangedEvent::kDescriptor, &device::LifecycleChangedEvent::kDescriptor,
      &device::FaultChangedEvent::kDescriptor,   &device::LeaseChangedEvent::kDescriptor,
      &device::StopChangedEvent::kDescriptor,    &device::ConfigurationChangedEvent::kDescriptor};
  const auto* const found = std::ranges::find(kTypes, type, &events::EventDescriptor::type);
  return found == std::end(kTypes) ? nullptr : *found;
}

}  // namespace

std::string played_name(const std::string& folder, const std::string& recorded_name) {
  return folder.empty() ? recorded_name : folder + "/" + recorded_name;
}

expected<std::unique_ptr<EventPlayer>, SetupError> EventPlayer::create(rpc::Node& node,
                                                                       const std::string& hub,
                                                                       const Recorded& recorded,
                                                                       const std::string& folder) {
  auto types = events::HubTypes::ask(node, hub);
  if (!types) return unexpected{types.error()};
  std::unique_ptr<EventPlayer> player(new EventPlayer(recorded, std::move(*types)));
  std::vector<const events::EventDescriptor*> known;
  for (const RecordedSource& source : recorded.sources) {
    player->sources_.push_back(
        source.device.empty() ? source.source : gvd::source_of(played_name(folder, source.device)));
    const events::EventDescriptor* type = own_type(source.type);
    if (type == nullptr) type = player->types_.find(source.type);
    const bool is_known = type != nullptr && type->schema_id == source.schema_id;
    if (is_known && std::ranges::count(known, type) == 0) known.push_back(type);
    const std::string name =
        source.type_name.empty() ? std::to_string(source.type) : source.type_name;
    std::vector<std::string>& unknown = player->unknown_types_;
    if (!is_known && std::ranges::count(unknown, name) == 0) unknown.push_back(name);
  }
  for (const RecordedSource& source : recorded.sources) {
    if (player->suppliers_.contains(source.priority)) continue;
    auto supplier = events::Supplier::create(
        node, hub, {.name = "rtpm play", .priority = source.priority, .types = known});
    if (!supplier) return unexpected{supplier.error()};
    player->suppliers_.emplace(source.priority, std::move(*supplier));
  }
  return player;
}

void EventPlayer::push(const RecordedEvent& event, MonotonicTime origin) {
  const RecordedSource& source = recorded_.sources[event.source];
  const ConstBytes payload = std::span(recorded_.payloads).subspan(event.offset, event.size);
  const auto pushed = suppliers_.at(source.priority)
                          ->push({.type = source.type,
                                  .source = sources_[event.source],
                                  .schema_id = source.schema_id,
                                  .payload = payload,
                                  .origin = origin});
  ++(pushed ? pushed_count_ : failed_count_);
}

void EventPlayer::push_until(Duration at, MonotonicTime now, std::optional<double> speed) {
  while (next_ < recorded_.events.size() && recorded_.events[next_].at <= at) {
    const RecordedEvent& event = recorded_.events[next_++];
    const double ago_ns = speed ? static_cast<double>((at - event.at).count()) / *speed : 0.0;
    push(event, now - Duration{static_cast<Duration::rep>(ago_ns)});
  }
}

void EventPlayer::advance(const Pace::Position& position, MonotonicTime now,
                          std::optional<double> speed) {
  if (position.round != round_) {
    push_until(recorded_.length, now, speed);
    next_ = 0;
    round_ = position.round;
  }
  push_until(position.at, now, speed);
}

}  // namespace rtpm::replay
