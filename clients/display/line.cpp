#include "line.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "rtpm/base/printable.hpp"
#include "rtpm/driver/vector.hpp"
#include "rtpm/program/text.hpp"

namespace rtpm::display {
namespace {

using program::formatted;

using driver::Descriptor;
using driver::Sample;

constexpr std::size_t kValueCountMax = 3;  ///< Maximum number of joints, analogs and outputs each.

bool has_axis(const Descriptor& descriptor, std::string_view name) {
  return std::ranges::any_of(descriptor.axes, [name](const driver::Axis& axis) {
    return axis.is_sensed && axis.name == name;
  });
}

bool has_force(const Descriptor& descriptor) {
  return std::ranges::any_of(descriptor.axes, &driver::Axis::is_actuated);
}

double force_newton(const Sample& sample) noexcept {
  return length(sample.wrench_applied.force_newton);
}

/// The direction of the frame's -z axis, in degrees.
struct Gaze {
  double right_deg = 0;
  double up_deg = 0;
};

Gaze gaze_of(const driver::Quaternion& q) noexcept {
  constexpr double kDegrees = 180 / std::numbers::pi;
  const double x = -2 * (q.x * q.z + q.w * q.y);
  const double y = -2 * (q.y * q.z - q.w * q.x);
  const double z = -(1 - 2 * (q.x * q.x + q.y * q.y));
  return {kDegrees * std::atan2(x, -z), kDegrees * std::atan2(y, std::hypot(x, z))};
}

/// A value with its unit, such as "5.2 µS", "48.2°", "0.84".
std::string quantity(double value, const std::string& unit) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  if (unit == "rad") return formatted("%+7.1f°", value * kDegrees);
  if (unit == "1" || unit.empty()) return formatted("%4.2f", value);
  struct Prefix {
    double factor;
    const char* name;
  };
  constexpr std::array kPrefixes{Prefix{1, ""}, Prefix{1e3, "m"}, Prefix{1e6, "µ"}};
  const auto* prefix = std::ranges::find_if(
      kPrefixes, [value](const Prefix& one) { return std::abs(value) * one.factor >= 0.1; });
  if (prefix == kPrefixes.end()) prefix = kPrefixes.begin();
  return formatted("%5.2f ", value * prefix->factor) + prefix->name + printable(unit);
}

void add(std::string& line, const std::string& part) {
  line += (line.empty() ? "" : "  ") + part;
}

/// Appends "NAME value unit" of some channels.
template <class Channels, class Values>
void add_channels(std::string& line, const Channels& channels, const Values& values) {
  for (std::size_t i = 0; i < std::min(channels.size(), kValueCountMax); ++i) {
    add(line, printable(channels[i].name) + " " +
                  quantity(static_cast<double>(values[i]), channels[i].unit));
  }
}

}  // namespace

double first_value(const Descriptor& descriptor, const Sample& sample) noexcept {
  if (has_force(descriptor)) return force_newton(sample);
  if (has_axis(descriptor, "x")) return sample.pose.position_m.x;
  if (has_axis(descriptor, "ry")) return gaze_of(sample.pose.orientation).right_deg;
  if (!descriptor.joints.empty()) return sample.joints[0];
  if (!descriptor.analogs.empty()) return static_cast<double>(sample.analogs[0]);
  return static_cast<double>(sample.outputs_applied[0]);
}

std::string values_text(const Descriptor& descriptor, const Sample& sample) {
  std::string line;
  if (has_axis(descriptor, "x")) {
    const driver::Vector3& at = sample.pose.position_m;
    add(line, formatted("at %+6.1f %+6.1f %+6.1f mm", at.x * 1e3, at.y * 1e3, at.z * 1e3));
  } else if (has_axis(descriptor, "ry")) {
    const Gaze gaze = gaze_of(sample.pose.orientation);
    add(line, formatted("looks %4.1f° %-5s %4.1f° %-4s", std::abs(gaze.right_deg),
                        gaze.right_deg >= 0 ? "right" : "left", std::abs(gaze.up_deg),
                        gaze.up_deg >= 0 ? "up" : "down"));
  }
  if (has_force(descriptor)) add(line, formatted("force %5.2f N", force_newton(sample)));
  add_channels(line, descriptor.joints, sample.joints);
  add_channels(line, descriptor.analogs, sample.analogs);
  add_channels(line, descriptor.outputs, sample.outputs_applied);
  for (std::size_t i = 0; i < descriptor.buttons.size(); ++i) {
    if ((sample.buttons >> i & 1U) != 0) add(line, "[" + printable(descriptor.buttons[i]) + "]");
  }
  return line;
}

std::string curve_text(std::span<const double> values) {
  constexpr std::array kBlocks{"▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
  if (values.empty()) return {};
  const auto [least, greatest] = std::ranges::minmax(values);
  const double span = greatest - least;
  std::string curve;
  for (const double value : values) {
    const double share = span > 0 ? (value - least) / span : 0;
    curve +=
        kBlocks[std::min(static_cast<std::size_t>(share * kBlocks.size()), kBlocks.size() - 1)];
  }
  return curve;
}

std::size_t width_of(std::string_view text) noexcept {
  // Bytes of the form 10xxxxxx continue a character.
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char byte) { return (static_cast<unsigned char>(byte) & 0xc0) != 0x80; }));
}

std::string fitted(std::string_view text, std::size_t width) {
  std::size_t end = 0;
  std::size_t column = 0;
  while (end < text.size()) {
    std::size_t next = end + 1;
    while (next < text.size() && (static_cast<unsigned char>(text[next]) & 0xc0) == 0x80)
      ++next;
    if (column == width) break;
    ++column;
    end = next;
  }
  return std::string(text.substr(0, end)) + std::string(width - column, ' ');
}

}  // namespace rtpm::display
