#include "device_schemas.hpp"

#include <device.rtpm.hpp>

#include "rtpm/base/assert.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/schema/dynamic.hpp"

namespace rtpm::capture {

expected<std::uint16_t, SetupError> add_device_channel(recording::Recorder& recorder,
                                                       const std::string& device,
                                                       const DeviceChannel& channel) {
  const rpc::InterfaceDescriptor& interface = device::DeviceClient::interface();
  std::string error;
  const auto dynamic = schema::Dynamic::make(std::string(interface.schema), interface.name, error);
  RTPM_ASSERT(dynamic != nullptr, "generated code has a schema that can be read");
  const auto bytes = dynamic->reflection();
  const auto schema = recorder.add_schema(
      {.name = channel.type, .encoding = "flatbuffer", .data = {bytes.begin(), bytes.end()}});
  if (!schema) return unexpected{schema.error()};
  return recorder.add_channel(
      {.schema_id = *schema,
       .topic = device + "/" + channel.leaf,
       .message_encoding = "flatbuffer",
       .metadata = {{kKindKey, channel.kind},
                    {kDeviceKey, device},
                    {kSourceKey, std::to_string(gvd::source_of(device))},
                    {kSchemaIdKey, std::to_string(interface.fingerprint)}}});
}

}  // namespace rtpm::capture
