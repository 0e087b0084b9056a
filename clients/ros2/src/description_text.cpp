#include "description_text.hpp"

#include <charconv>
#include <initializer_list>
#include <utility>
#include <vector>

namespace rtpm::ros2 {
namespace {

/// A text in double quotes, as YAML reads it.
std::string quoted(std::string_view text) {
  std::string result = "\"";
  for (const char byte : text) {
    const auto code = static_cast<unsigned char>(byte);
    if (code < 0x20) {
      result += ' ';
      continue;
    }
    if (byte == '"' || byte == '\\') result += '\\';
    result += byte;
  }
  return result + '"';
}

std::string number(double value) {
  std::array<char, 32> text{};
  const auto result = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), result.ptr};
}

/// "{name: "x", unit: "m"}".
std::string entry(std::initializer_list<std::pair<const char*, std::string>> fields) {
  std::string text = "{";
  for (const auto& [key, value] : fields)
    text += (text.size() == 1 ? "" : ", ") + std::string(key) + ": " + value;
  return text + "}";
}

template <class Parts, class ToText>
void add_list(std::string& text, const char* key, const Parts& parts, ToText to_text) {
  if (parts.empty()) return;
  text += std::string(key) + ":\n";
  for (const auto& part : parts)
    text += "- " + to_text(part) + "\n";
}

}  // namespace

std::string description_text(std::string_view name, const driver::Descriptor& descriptor) {
  std::string text;
  const auto add = [&text](const char* key, const std::string& value) {
    text += std::string(key) + ": " + value + "\n";
  };
  const auto truth = [](bool value) { return std::string(value ? "true" : "false"); };
  add("device", quoted(name));
  add("class", quoted(to_string(descriptor.device_class)));
  add("model", quoted(descriptor.model));
  add("serial", quoted(descriptor.serial));
  add("frame", quoted(descriptor.frame));
  add("rate_hz", number(descriptor.rate_hz));
  add("force_newton_max", number(descriptor.limits.force_newton_max));
  add("torque_newton_metre_max", number(descriptor.limits.torque_newton_metre_max));
  add("velocity_m_per_s_max", number(descriptor.limits.velocity_m_per_s_max));
  add("velocity_rad_per_s_max", number(descriptor.limits.velocity_rad_per_s_max));
  add_list(text, "axes", descriptor.axes, [&](const driver::Axis& axis) {
    return entry({{"name", quoted(axis.name)},
                  {"is_sensed", truth(axis.is_sensed)},
                  {"is_actuated", truth(axis.is_actuated)}});
  });
  add_list(text, "buttons", descriptor.buttons, quoted);
  add_list(text, "analogs", descriptor.analogs, [](const driver::Analog& analog) {
    return entry({{"name", quoted(analog.name)},
                  {"unit", quoted(analog.unit)},
                  {"low", number(analog.low)},
                  {"high", number(analog.high)}});
  });
  add_list(text, "joints", descriptor.joints, [](const driver::Joint& joint) {
    return entry({{"name", quoted(joint.name)},
                  {"unit", quoted(joint.unit)},
                  {"low", number(joint.low)},
                  {"high", number(joint.high)},
                  {"effort_max", number(joint.effort_max)}});
  });
  add_list(text, "command_modes", descriptor.modes,
           [](driver::CommandMode mode) { return quoted(to_string(mode)); });
  return text;
}

}  // namespace rtpm::ros2
