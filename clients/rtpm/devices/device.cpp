#include "devices/device.hpp"

#include "objects/unbound.hpp"

namespace rtpm::tool {

expected<gvd::DeviceClient, SetupError> open_device(Context& context, const std::string& name) {
  gvd::DeviceClientOptions options;
  options.bind.deadline = context.deadline.value_or(options.bind.deadline);
  auto device = gvd::DeviceClient::open(context.node(), name, options);
  if (device) return device;
  return unexpected{named(name, with_similar_names(context, name, device.error()))};
}

}  // namespace rtpm::tool
