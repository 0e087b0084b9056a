#include "view_recorder.hpp"

#include <utility>

#include "rtpm/capture/channels.hpp"
#include "rtpm/gvd/device_event.hpp"

namespace rtpm::capture {

void ViewRecorder::add(const std::string& device, const driver::Descriptor& descriptor) {
  const events::SourceId source = gvd::source_of(device);
  if (has(source)) return;
  Device added{.view = viewers::DeviceView(device, descriptor)};
  for (const viewers::Channel& channel : added.view.channels())
    added.channels.push_back(add_channel(channel, device));
  devices_.emplace(source, std::move(added));
}

std::uint16_t ViewRecorder::add_channel(const viewers::Channel& channel,
                                        const std::string& device) {
  const bool is_shared = channel.topic == viewers::kTransformTopic;
  if (is_shared && transforms_ != 0) return transforms_;
  const viewers::Schema type = viewers::schema_of(channel.type);
  const auto schema =
      recorder_.add_schema({.name = std::string(type.name),
                            .encoding = "flatbuffer",
                            .data = {type.reflection.begin(), type.reflection.end()}});
  if (!schema) return 0;
  recording::Channel added{.schema_id = *schema,
                           .topic = channel.topic,
                           .message_encoding = "flatbuffer",
                           .metadata = {{kKindKey, kViewKind}}};
  if (!is_shared) added.metadata[kDeviceKey] = device;
  const auto number = recorder_.add_channel(added);
  if (is_shared) transforms_ = number.value_or(0);
  return number.value_or(0);
}

void ViewRecorder::set_models(events::SourceId source, const gvd::ModelList& models,
                              std::uint64_t publish_time_ns) noexcept {
  const auto found = devices_.find(source);
  if (found != devices_.end()) found->second.view.set_models(models, publish_time_ns);
}

void ViewRecorder::record(events::SourceId source, const driver::Sample& sample,
                          std::uint64_t log_time_ns, std::uint64_t publish_time_ns) {
  const auto found = devices_.find(source);
  if (found == devices_.end()) return;
  Device& device = found->second;
  for (const auto& due : device.view.take(sample, publish_time_ns)) {
    const std::uint16_t channel = device.channels[due.channel];
    if (channel == 0) continue;
    static_cast<void>(track_.put({.channel_id = channel,
                                  .sequence = static_cast<std::uint32_t>(sample.sequence),
                                  .log_time_ns = log_time_ns,
                                  .publish_time_ns = publish_time_ns,
                                  .data = due.message}));
  }
}

}  // namespace rtpm::capture
