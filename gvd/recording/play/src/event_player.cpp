#include "event_player.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "rtpm/gvd/device_event.hpp"

namespace rtpm::replay {
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
    const events::EventDescriptor* type = gvd::device_event_type(source.type);
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
  (pushed ? pushed_count_ : failed_count_).fetch_add(1, std::memory_order_relaxed);
}

void EventPlayer::play(Duration from, const Turn& turn) {
  for (auto next = std::ranges::lower_bound(recorded_.events, from, {}, &RecordedEvent::at);
       next != recorded_.events.end() && turn.reach(next->at); ++next) {
    push(*next, turn.due(next->at));
  }
}

}  // namespace rtpm::replay
