#include "rtpm/gvd/offer.hpp"

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/driver/command.hpp"

namespace rtpm::gvd {
namespace {

/// A device's text in the form that a registry accepts.
std::string text(std::string_view words) {
  std::string shown = printable(words, names::kPropertyTextSizeMax);
  if (shown.size() > names::kPropertyTextSizeMax) shown.clear();
  return shown;
}

template <class Items, class NameOf>
names::PropertyList names_of(const Items& items, NameOf name_of) {
  names::PropertyList list{names::PropertyType::kText, {}};
  for (const auto& item : items) {
    if (list.items.size() == names::kPropertyListSizeMax) break;
    list.items.emplace_back(text(name_of(item)));
  }
  return list;
}

template <class Items>
void add_names(std::vector<names::Property>& properties, const char* name, const Items& items) {
  if (items.empty()) return;
  properties.push_back({name, names_of(items, [](const auto& item) { return item.name; })});
}

void add_limit(std::vector<names::Property>& properties, const char* name, double value,
               const char* unit) {
  if (value > 0) properties.push_back({name, value, unit});
}

}  // namespace

std::vector<names::Property> properties_of(const driver::Descriptor& descriptor, double rate_hz) {
  std::vector<names::Property> properties{
      {"class", std::string(to_string(descriptor.device_class))},
      {"model", text(descriptor.model)},
      {"serial", text(descriptor.serial)},
      {"frame", text(descriptor.frame)},
      {"rate_hz", rate_hz, "hertz"},
      {"button_count", static_cast<std::int64_t>(descriptor.buttons.size())}};
  std::vector<driver::Axis> actuated = descriptor.axes;
  std::erase_if(actuated, [](const driver::Axis& axis) { return !axis.is_actuated; });
  add_names(properties, "axes", descriptor.axes);
  add_names(properties, "actuated_axes", actuated);
  add_names(properties, "analogs", descriptor.analogs);
  add_names(properties, "joints", descriptor.joints);
  add_names(properties, "outputs", descriptor.outputs);
  if (!descriptor.modes.empty()) {
    properties.push_back({"modes", names_of(descriptor.modes, [](driver::CommandMode mode) {
                            return std::string(to_string(mode));
                          })});
  }
  const driver::Limits& limits = descriptor.limits;
  add_limit(properties, "force_newton_max", limits.force_newton_max, "newton");
  add_limit(properties, "torque_newton_metre_max", limits.torque_newton_metre_max, "newton metre");
  add_limit(properties, "velocity_m_per_s_max", limits.velocity_m_per_s_max, "metre per second");
  add_limit(properties, "stiffness_newton_per_m_max", limits.stiffness_newton_per_m_max,
            "newton per metre");
  return properties;
}

}  // namespace rtpm::gvd
