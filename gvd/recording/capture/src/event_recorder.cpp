#include "event_recorder.hpp"

#include <algorithm>
#include <cstring>
#include <device_events.rtpm.events.hpp>
#include <mutex>
#include <utility>

#include "flatbuffer_channel.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/gvd/models_wire.hpp"
#include "rtpm/gvd/wire.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::capture {

namespace {

/// The bytes that a held event takes, including bookkeeping.
std::size_t cost_of(ConstBytes payload) {
  constexpr std::size_t kOverhead = 128;
  return payload.size() + kOverhead;
}

/// Finds a type among `types`; null if unknown.
const events::EventDescriptor* find_in(KnownTypes types, events::EventType type) {
  const auto found = std::ranges::find(types, type, &events::EventDescriptor::type);
  return found == types.end() ? nullptr : *found;
}

}  // namespace

EventRecorder::EventRecorder(recording::Recorder& recorder, bool names_devices)
    : names_devices_(names_devices),
      recorder_(recorder),
      track_(recorder.add_track()),
      views_(recorder, track_) {}

void EventRecorder::record(const events::EventView& event, const events::EventDescriptor* type,
                           bool is_hub_local) {
  const std::lock_guard lock(mutex_);
  const events::EventHeader& header = event.header;
  const Key key{header.type, header.source};
  const MonotonicTime now = rt::now();
  // Only differences of another host's times are valid.
  const MonotonicTime origin =
      is_hub_local ? header.origin : now - (header.hub_sent - header.origin);
  const bool is_settled_now = is_settled(header, type);
  // If the type already has a channel, an earlier event waited for the name without success.
  const bool may_wait = !is_settled_now && !channels_.contains(key) &&
                        held_byte_count_ + cost_of(event.payload) <= kHeldByteMax;
  if (may_wait) return hold(event, now, origin);
  let_go(key, type);
  put(header, event.payload, now, origin, type);
}

bool EventRecorder::is_settled(const events::EventHeader& header,
                               const events::EventDescriptor* type) const {
  const bool has_type = type != nullptr || header.type > events::kEventTypeMax;
  return has_type && !lacks_name(header);
}

bool EventRecorder::lacks_name(const events::EventHeader& header) const {
  return names_devices_ && is_device_event(header.type) && !devices_.contains(header.source);
}

void EventRecorder::hold(const events::EventView& event, MonotonicTime received,
                         MonotonicTime origin) {
  held_[{event.header.type, event.header.source}].push_back(
      {event.header, {event.payload.begin(), event.payload.end()}, received, origin});
  held_byte_count_ += cost_of(event.payload);
}

void EventRecorder::let_go(const Key& key, const events::EventDescriptor* type) {
  const auto found = held_.find(key);
  if (found == held_.end()) return;
  for (const Held& held : found->second) {
    put(held.header, held.payload, held.received, held.origin, type);
    held_byte_count_ -= cost_of(held.payload);
  }
  held_.erase(found);
}

void EventRecorder::let_go_if(KnownTypes types, bool is_end) {
  const std::lock_guard lock(mutex_);
  const MonotonicTime now = rt::now();
  for (auto next = held_.begin(); next != held_.end();) {
    const auto& [key_here, held] = *next;
    const Key key = key_here;
    ++next;  // Advance first: the entry may be erased.
    const events::EventDescriptor* const type = find_in(types, key.first);
    const bool is_over = is_end || now - held.front().received >= kHoldTimeMax;
    if (is_over || is_settled(held.front().header, type)) let_go(key, type);
  }
}

void EventRecorder::attend(KnownTypes types) {
  let_go_if(types, false);
}

void EventRecorder::finish(KnownTypes types) {
  let_go_if(types, true);
}

bool EventRecorder::is_holding() const {
  const std::lock_guard lock(mutex_);
  return !held_.empty();
}

void EventRecorder::put(const events::EventHeader& header, ConstBytes payload,
                        MonotonicTime received, MonotonicTime origin,
                        const events::EventDescriptor* type) {
  const ChannelOfEvents* const channel = channel_of(header, type);
  if (channel == nullptr) return;
  recording::Message message{.channel_id = channel->number,
                             .sequence = static_cast<std::uint32_t>(header.sequence),
                             .log_time_ns = recorder_.log_time_ns(received),
                             .publish_time_ns = recorder_.log_time_ns(origin),
                             .data = payload};
  std::optional<std::vector<std::byte>> table;
  if (channel->dynamic != nullptr) {
    table = channel->dynamic->as_table(channel->dynamic->event(), payload);
    if (table) message.data = *table;
  }
  static_cast<void>(track_.put(message));
  put_view(header, payload, message);
}

void EventRecorder::put_view(const events::EventHeader& header, ConstBytes payload,
                             const recording::Message& recorded) {
  if (!views_.has(header.source)) return;
  if (header.type == gvd::kModelsRendered) {
    if (const auto models = gvd::models_of(header.schema_id, payload)) {
      views_.set_models(header.source, *models, recorded.publish_time_ns);
    }
    return;
  }
  device::Sample wire;
  const bool is_sample = header.type == gvd::kSampled && payload.size() == sizeof wire &&
                         header.schema_id == device::SampledEvent::kSchemaId;
  if (!is_sample) return;
  std::memcpy(&wire, payload.data(), sizeof wire);
  views_.record(header.source, gvd::from_wire(wire), recorded.log_time_ns,
                recorded.publish_time_ns);
}

void EventRecorder::name_devices(std::span<const std::string> names) {
  const std::lock_guard lock(mutex_);
  for (const std::string& name : names)
    devices_.insert_or_assign(gvd::source_of(name), name);
}

void EventRecorder::add_view(const std::string& device, const driver::Descriptor& descriptor) {
  const std::lock_guard lock(mutex_);
  views_.add(device, descriptor);
}

std::vector<std::string> EventRecorder::take_new_devices() {
  const std::lock_guard lock(mutex_);
  return std::exchange(new_devices_, {});
}

bool EventRecorder::take_new_unnamed() {
  const std::lock_guard lock(mutex_);
  const bool waits = std::ranges::any_of(
      held_, [this](const auto& held) { return lacks_name(held.second.front().header); });
  return std::exchange(has_new_unnamed_, false) || waits;
}

const std::string* EventRecorder::device_of(const events::EventHeader& header) {
  if (!is_device_event(header.type)) return nullptr;
  const auto known = devices_.find(header.source);
  if (known == devices_.end()) {
    if (seen_unnamed_.insert(header.source).second) has_new_unnamed_ = true;
    return nullptr;
  }
  if (seen_devices_.insert(header.source).second) new_devices_.push_back(known->second);
  return &known->second;
}

EventRecorder::ChannelOfEvents* EventRecorder::channel_of(const events::EventHeader& header,
                                                          const events::EventDescriptor* type) {
  const auto known = channels_.find({header.type, header.source});
  const std::string* const device = device_of(header);
  // Schema and name may become known later: then the source continues in a new channel.
  const bool has_schema = type != nullptr && !type->schema.empty();
  const bool is_known = known != channels_.end();
  const bool keeps_name = is_known && known->second.is_named == (device != nullptr);
  if (keeps_name && (known->second.dynamic != nullptr || !has_schema)) return &known->second;
  schema::Dynamic* const dynamic = schemas_.find(type);
  if (keeps_name && dynamic == nullptr) return &known->second;
  const auto number = add_channel(header, type, dynamic, device);
  if (!number) return nullptr;
  ChannelOfEvents& channel = channels_[{header.type, header.source}];
  channel = {*number, dynamic, device != nullptr};
  return &channel;
}

expected<std::uint16_t, SetupError> EventRecorder::add_channel(const events::EventHeader& header,
                                                               const events::EventDescriptor* type,
                                                               const schema::Dynamic* dynamic,
                                                               const std::string* device) {
  recording::Channel channel;
  const std::string name = type_text(header.type, type);
  channel.topic = device != nullptr && type != nullptr ? device_topic(*device, name)
                                                       : name + "/" + std::to_string(header.source);
  channel.metadata = {{kKindKey, kEventKind},
                      {kTypeKey, std::to_string(header.type)},
                      {kSourceKey, std::to_string(header.source)},
                      {kSchemaIdKey, std::to_string(header.schema_id)},
                      {kPriorityKey, std::to_string(header.priority.value())}};
  if (type != nullptr) channel.metadata[kNameKey] = name;
  if (device != nullptr) channel.metadata[kDeviceKey] = *device;
  if (dynamic == nullptr) return recorder_.add_channel(channel);
  if (const auto struct_index = dynamic->event().struct_index) {
    channel.metadata[kStructSizeKey] =
        std::to_string(dynamic->model().objects[*struct_index].byte_size);
  }
  return add_flatbuffer_channel(recorder_, *dynamic, std::string(type->name),
                                std::move(channel.topic), std::move(channel.metadata));
}

}  // namespace rtpm::capture
