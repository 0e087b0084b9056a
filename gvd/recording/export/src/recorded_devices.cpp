#include "recorded_devices.hpp"

#include <cstring>
#include <device.rtpm.hpp>
#include <device_events.rtpm.events.hpp>
#include <vector>

#include "rtpm/capture/channels.hpp"
#include "rtpm/capture/read_events.hpp"
#include "rtpm/gvd/wire.hpp"

namespace rtpm::exports {

using capture::value_of;

expected<Devices, SetupError> read_devices(recording::FileReader& reader,
                                           const recording::Progress& progress) {
  Devices devices;
  recording::Query query;
  const std::string version = std::to_string(device::DeviceClient::interface().fingerprint);
  for (const auto& [number, channel] : reader.channels()) {
    if (value_of(channel, capture::kKindKey) == capture::kDescriptionKind &&
        value_of(channel, capture::kSchemaIdKey) == version)
      query.channel_ids.push_back(number);
  }
  if (query.channel_ids.empty()) return devices;
  const auto take = [&](const recording::Message& message) {
    const std::vector<std::byte> bytes(message.data.begin(), message.data.end());
    if (rpc::is_valid_table<device::Description>(bytes)) {
      const std::string name =
          value_of(reader.channels().at(message.channel_id), capture::kDeviceKey);
      devices[name] = gvd::from_wire(*flatbuffers::GetRoot<device::Description>(bytes.data()));
    }
    return true;
  };
  if (auto read = reader.read(query, take, progress); !read) return unexpected{read.error()};
  return devices;
}

bool has_samples(const recording::FileReader& reader, const recording::Channel& channel) {
  const auto schema = reader.schemas().find(channel.schema_id);
  return schema != reader.schemas().end() &&
         schema->second.name == device::SampledEvent::kDescriptor.name &&
         value_of(channel, capture::kSchemaIdKey) ==
             std::to_string(device::SampledEvent::kSchemaId);
}

std::optional<driver::Sample> sample_of(const recording::Message& message) {
  const ConstBytes bytes = capture::struct_in_table(message.data, sizeof(device::Sample));
  if (bytes.empty()) return std::nullopt;
  device::Sample wire{};
  std::memcpy(&wire, bytes.data(), sizeof wire);
  return gvd::from_wire(wire);
}

}  // namespace rtpm::exports
