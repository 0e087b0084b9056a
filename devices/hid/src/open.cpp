#include "rtpm/device_hid/open.hpp"

#include <utility>

#include "rtpm/device_hid/hid_driver.hpp"
#include "rtpm/device_hid/profile.hpp"

namespace rtpm::device_hid {

expected<std::unique_ptr<driver::Driver>, SetupError> open(std::string_view arguments,
                                                           std::string_view device_name) {
  auto settings = read_settings(arguments);
  if (!settings) return unexpected{settings.error()};
  auto made = HidDriver::create(make_hid_system(), std::move(*settings), device_name);
  if (!made) return unexpected{made.error()};
  return std::unique_ptr<driver::Driver>(std::move(*made));
}

std::vector<device_io::FoundDevice> found_among(const std::vector<Unit>& units) {
  std::vector<device_io::FoundDevice> found;
  for (const Unit& unit : units) {
    const auto kind = kind_of(unit);
    std::string refusal = refusal_of(unit);
    if (!kind && refusal.empty()) continue;
    found.push_back({.driver = "hid",
                     .model = unit.model,
                     .serial = unit.serial,
                     .node = unit.node,
                     .arguments = "node=" + unit.node,
                     .missing_right = device_io::missing_right(unit.node),
                     .udev_rule = device_io::udev_rule("hidraw", unit.vendor, unit.product),
                     .left_out = kind ? make_profile(*kind, &unit, 0)->left_out() : "",
                     .refusal = std::move(refusal)});
  }
  return found;
}

std::vector<device_io::FoundDevice> probe() {
  return found_among(make_hid_system()->units());
}

}  // namespace rtpm::device_hid
