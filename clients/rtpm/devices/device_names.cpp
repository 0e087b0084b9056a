#include "devices/device_names.hpp"

#include "rtpm/names/directory.hpp"

namespace rtpm::tool {

expected<std::vector<std::string>, SetupError> device_names(Context& context) {
  const auto entries = names::Directory(context.node(), context.registry).list();
  if (!entries) return unexpected{SetupError{entries.error()}};
  std::vector<std::string> names;
  for (const names::NameEntry& entry : *entries) {
    if (entry.interface == kDeviceInterface) names.push_back(entry.name);
  }
  return names;
}

}  // namespace rtpm::tool
