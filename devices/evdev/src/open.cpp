#include "rtpm/device_evdev/open.hpp"

#include <string>

#include "evdev_node.hpp"
#include "rtpm/device_evdev/evdev_driver.hpp"
#include "rtpm/device_evdev/layout.hpp"
#include "rtpm/device_evdev/settings.hpp"
#include "udev_units.hpp"

namespace rtpm::device_evdev {

namespace {

/// Also empty if this user may not open the device.
std::string left_out_of(const Unit& unit) {
  const auto opened = open_node(unit, false);
  return opened ? make_layout((*opened)->capabilities(), {}).left_out : std::string();
}

}  // namespace

Access machine_access() {
  Access access;
  access.list = [] {
    std::vector<Unit> units;
    for (const FoundUnit& found : list_units())
      units.push_back(found.unit);
    return units;
  };
  access.open = &open_node;
  return access;
}

expected<std::unique_ptr<driver::Driver>, SetupError> open(std::string_view arguments,
                                                           std::string_view device_name) {
  auto settings = read_settings(arguments);
  if (!settings) return unexpected{settings.error()};
  return std::make_unique<EvdevDriver>(machine_access(), std::move(*settings),
                                       std::string(device_name) + "/base");
}

std::vector<device_io::FoundDevice> probe() {
  std::vector<device_io::FoundDevice> devices;
  for (const auto& [unit, is_desktop] : list_units()) {
    if (is_desktop) continue;
    devices.push_back({.driver = "evdev",
                       .model = unit.name,
                       .serial = unit.serial,
                       .node = unit.node,
                       .arguments = "node=" + unit.node,
                       .missing_right = device_io::missing_right(unit.node),
                       .udev_rule = device_io::udev_rule("input", unit.vendor, unit.product),
                       .left_out = left_out_of(unit)});
  }
  return devices;
}

}  // namespace rtpm::device_evdev
