#include "rtpm/capture/channels.hpp"

#include "rtpm/gvd/device_event.hpp"

namespace rtpm::capture {

std::string value_of(const recording::Channel& channel, const char* key) {
  const auto found = channel.metadata.find(key);
  return found == channel.metadata.end() ? std::string{} : found->second;
}

bool is_device_event(events::EventType type) noexcept {
  return (type >= gvd::kSampled && type <= gvd::kConfigurationChanged) ||
         type == gvd::kModelsRendered;
}

std::string device_topic(std::string_view device, std::string_view type) {
  const std::string_view name = type.substr(type.rfind('.') + 1);
  std::string topic(device);
  topic += '/';
  for (std::size_t i = 0; i < name.size(); ++i) {
    const bool is_upper = name[i] >= 'A' && name[i] <= 'Z';
    if (is_upper && i > 0) topic += '_';
    topic += is_upper ? static_cast<char>(name[i] - 'A' + 'a') : name[i];
  }
  return topic;
}

}  // namespace rtpm::capture
