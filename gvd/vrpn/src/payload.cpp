#include "rtpm/vrpn/payload.hpp"

#include <cmath>

#include "network_order.hpp"

namespace rtpm::vrpn {
namespace {

constexpr std::size_t kPoseSize = 64;

void put_vector(Payload& to, const driver::Vector3& vector) {
  put_double(to, vector.x);
  put_double(to, vector.y);
  put_double(to, vector.z);
}

void put_sensor(Payload& to, std::int32_t sensor) {
  put_u32(to, static_cast<std::uint32_t>(sensor));
  put_u32(to, 0);  // Aligns the numbers that follow.
}

/// The rotation by a constant angular velocity in `span_s`.
driver::Quaternion rotation_of(const driver::Vector3& rad_per_s, double span_s) {
  const double speed = std::hypot(rad_per_s.x, rad_per_s.y, rad_per_s.z);
  if (speed == 0) return {};
  const double half = speed * span_s / 2;
  const double scale = std::sin(half) / speed;
  return {rad_per_s.x * scale, rad_per_s.y * scale, rad_per_s.z * scale, std::cos(half)};
}

}  // namespace

Payload name_payload(std::string_view name) {
  Payload payload;
  put_u32(payload, static_cast<std::uint32_t>(name.size() + 1));
  for (const char letter : name)
    payload.push_back(static_cast<std::byte>(letter));
  payload.push_back(std::byte{0});
  return payload;
}

Payload pose_payload(std::int32_t sensor, const driver::Pose& pose) {
  Payload payload;
  put_sensor(payload, sensor);
  put_vector(payload, pose.position_m);
  for (const double part :
       {pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w})
    put_double(payload, part);
  return payload;
}

Payload velocity_payload(std::int32_t sensor, const driver::Twist& twist, double span_s) {
  Payload payload;
  put_sensor(payload, sensor);
  put_vector(payload, twist.linear_m_per_s);
  const driver::Quaternion turned = rotation_of(twist.angular_rad_per_s, span_s);
  for (const double part : {turned.x, turned.y, turned.z, turned.w, span_s})
    put_double(payload, part);
  return payload;
}

Payload button_payload(std::int32_t button, bool is_pressed) {
  Payload payload;
  put_u32(payload, static_cast<std::uint32_t>(button));
  put_u32(payload, is_pressed ? 1 : 0);
  return payload;
}

Payload analog_payload(std::span<const float> channels) {
  Payload payload;
  put_double(payload, static_cast<double>(channels.size()));
  for (const float channel : channels)
    put_double(payload, channel);
  return payload;
}

Payload force_payload(const driver::Vector3& force_newton) {
  Payload payload;
  put_vector(payload, force_newton);
  return payload;
}

std::optional<std::string> read_name(ConstBytes payload) {
  if (payload.size() < 5) return std::nullopt;
  const std::size_t size = u32_at(payload, 0);
  if (size == 0 || size > payload.size() - 4) return std::nullopt;
  std::string name;
  for (const std::byte letter : payload.subspan(4, size)) {
    if (letter == std::byte{0}) break;
    name += static_cast<char>(letter);
  }
  return name;
}

std::optional<SensorPose> read_pose(ConstBytes payload) noexcept {
  if (payload.size() != kPoseSize) return std::nullopt;
  std::array<double, 7> numbers{};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    numbers[i] = double_at(payload, 8 + 8 * i);
    if (!std::isfinite(numbers[i])) return std::nullopt;
  }
  return SensorPose{.sensor = static_cast<std::int32_t>(u32_at(payload, 0)),
                    .pose = {.position_m = {numbers[0], numbers[1], numbers[2]},
                             .orientation = {numbers[3], numbers[4], numbers[5], numbers[6]}}};
}

}  // namespace rtpm::vrpn
