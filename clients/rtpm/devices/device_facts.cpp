#include "devices/device_facts.hpp"

#include <cmath>
#include <span>
#include <string_view>

#include "devices/device.hpp"
#include "rtpm/base/nesting.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/program/text.hpp"

namespace rtpm::tool {
namespace {

using program::formatted;

/// The holder of the lease, by the object that newer servers have beside the device.
std::string lease_holder(Context& context, const std::string& url) {
  const auto object = dynamic::RemoteObject::open(context.node(), url + "/holder");
  if (!object) return {};
  std::string text;
  const auto called = (*object)->call("holder", "", context.call_options(), std::nullopt,
                                      [&](std::string_view json) {
                                        text = json;
                                        return true;
                                      });
  const auto reply = parse_bounded_json<nlohmann::json>(text);
  if (!called || !reply.is_object() || !reply.contains("is_held")) return {};
  if (!reply.value("is_held", false)) return "free";
  std::string name = reply.value("name", std::string());
  if (name.empty()) name = reply.value("key_name", std::string());
  const double held_s = reply.value("held_us", 0.0) * 1e-6;
  return "held" + (name.empty() ? std::string() : " by " + printable(name)) +
         (held_s > 0 ? formatted(" for %.0f s", held_s) : std::string());
}

void add_part(std::string& text, const std::string& part) {
  text += (text.empty() ? "" : ", ") + part;
}

template <class Part>
std::string part_names(const std::vector<Part>& parts) {
  std::string names;
  for (const Part& part : parts)
    names += ' ' + printable(part.name);
  return names;
}

std::string device_parts(const driver::Descriptor& descriptor) {
  std::string sensed;
  std::string actuated;
  for (const driver::Axis& axis : descriptor.axes) {
    if (axis.is_sensed) sensed += ' ' + printable(axis.name);
    if (axis.is_actuated) actuated += ' ' + printable(axis.name);
  }
  std::string text;
  if (!sensed.empty()) add_part(text, "measures" + sensed);
  if (!actuated.empty()) add_part(text, "forces along" + actuated);
  if (!descriptor.joints.empty()) add_part(text, "joints" + part_names(descriptor.joints));
  if (!descriptor.buttons.empty()) {
    std::string names;
    for (const std::string& name : descriptor.buttons)
      names += ' ' + printable(name);
    add_part(text, "buttons" + names);
  }
  if (!descriptor.analogs.empty()) add_part(text, "analogs" + part_names(descriptor.analogs));
  if (!descriptor.outputs.empty()) add_part(text, "outputs" + part_names(descriptor.outputs));
  return text;
}

std::string device_limits(const driver::Limits& limits) {
  const std::pair<double, const char*> all[] = {
      {limits.force_newton_max, "N"},
      {limits.torque_newton_metre_max, "N·m"},
      {limits.stiffness_newton_per_m_max, "N/m for walls"},
      {limits.velocity_m_per_s_max, "m/s"},
      {limits.velocity_rad_per_s_max, "rad/s"}};
  std::string text;
  for (const auto& [value, unit] : all) {
    if (value > 0 && std::isfinite(value)) add_part(text, formatted("%.4g %s", value, unit));
  }
  return text;
}

std::string device_workspace(const driver::Workspace& workspace) {
  const auto& [low, high] = workspace;
  if (low == high) return {};
  return formatted("x %.3g to %.3g, y %.3g to %.3g, z %.3g to %.3g m", low.x, high.x, low.y, high.y,
                   low.z, high.z);
}

std::string device_modes(const std::vector<driver::CommandMode>& modes) {
  std::string text;
  for (const driver::CommandMode mode : modes)
    add_part(text, std::string(to_string(mode)));
  return text.empty() ? "none: it only measures" : text;
}

}  // namespace

expected<DeviceFacts, SetupError> device_facts_of(Context& context, const std::string& url) {
  auto device = open_device(context, url);
  if (!device) return unexpected{std::move(device.error())};
  const auto sample = device->read(context.call_options());
  if (!sample) return setup_error(url, std::string(to_string(sample.error())));
  return DeviceFacts{device->descriptor(), *sample, lease_holder(context, url)};
}

FactLines lines_of(const DeviceFacts& facts) {
  const driver::Descriptor& descriptor = facts.descriptor;
  const driver::Sample& sample = facts.sample;
  std::string state(to_string(sample.lifecycle));
  if (!sample.faults.empty()) state += ", " + to_text(sample.faults);
  state += formatted(", %.0f %% of its cycles are good", 100.0 * double{sample.success_rate});
  FactLines lines{
      {"class", std::string(to_string(descriptor.device_class))},
      {"model", printable(descriptor.model) + ", serial " + printable(descriptor.serial)},
      {"frame", printable(descriptor.frame)},
      {"rate", formatted("%.6g Hz", descriptor.rate_hz)},
      {"parts", device_parts(descriptor)},
      {"commands", device_modes(descriptor.modes)},
      {"limits", device_limits(descriptor.limits)},
      {"workspace", device_workspace(descriptor.workspace)},
      {"lifecycle", state},
      {"lease", facts.holder}};
  std::erase_if(lines, [](const auto& line) { return line.second.empty(); });
  return lines;
}

Json json_of(const DeviceFacts& facts) {
  Json json{{"lifecycle", to_string(facts.sample.lifecycle)},
            {"faults", to_text(facts.sample.faults)}};
  if (!facts.holder.empty()) json["lease"] = facts.holder;
  return json;
}

}  // namespace rtpm::tool
