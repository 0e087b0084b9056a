#include "channels/media_channels.hpp"

#include <utility>

#include "foxglove/base64.hpp"

namespace rtpm::console {
namespace {

std::string topic_of(const std::string& name) {
  return name + "/video";
}

}  // namespace

void MediaChannels::set_media(const std::set<std::string>& names) {
  std::erase_if(media_, [&](const auto& one) {
    if (names.contains(one.first)) return false;
    channels_.remove(topic_of(one.first));
    return true;
  });
  for (const std::string& name : names) {
    if (media_.contains(name)) continue;
    media_[name].name = name;
    // The codec is known with the first picture, which needs a subscriber.
    advertise(name, viewers::Type::kCompressedVideo);
  }
}

void MediaChannels::advertise(const std::string& name, viewers::Type type) {
  const viewers::Schema schema = viewers::schema_of(type);
  channels_.add({.topic = topic_of(name),
                 .encoding = "flatbuffer",
                 .schema_name = std::string(schema.name),
                 .schema = foxglove::to_base64(schema.reflection),
                 .schema_encoding = "flatbuffer"});
  media_[name].type = type;
}

std::set<std::string> MediaChannels::watched() const {
  std::set<std::string> watched;
  for (const auto& [name, medium] : media_) {
    if (channels_.has_subscriber(channels_.find(topic_of(name)))) watched.insert(name);
  }
  return watched;
}

void MediaChannels::take(const MediumView& view) {
  const auto medium = media_.find(view.name);
  if (medium == media_.end()) return;
  if (view.message.empty()) {
    medium->second.problem = view.problem;
    return;
  }
  // Clients subscribe again to a channel of another schema.
  if (medium->second.type != view.type) advertise(view.name, view.type);
  channels_.publish_picture(channels_.find(topic_of(view.name)), view.log_time_ns, view.message,
                            view.is_key);
  medium->second = view;
  medium->second.message.clear();
}

nlohmann::ordered_json MediaChannels::state() const {
  nlohmann::ordered_json media = nlohmann::ordered_json::array();
  for (const auto& [name, medium] : media_) {
    media.push_back({{"name", name},
                     {"frame", medium.frame},
                     {"width_px", medium.width_px},
                     {"height_px", medium.height_px},
                     {"rate_hz", medium.rate_hz},
                     {"capture_ns", medium.log_time_ns},
                     {"uncertainty_ns", medium.uncertainty.count()},
                     {"lost_count", medium.lost_count},
                     {"problem", medium.problem}});
  }
  return media;
}

}  // namespace rtpm::console
