#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/driver/sample.hpp"

/// The payloads of VRPN's devices. Positions are in metres, quaternions x, y, z, w.
namespace rtpm::vrpn {

/// Names of types; each side describes them by its own numbers.
inline constexpr std::string_view kPoseType = "vrpn_Tracker Pos_Quat";
inline constexpr std::string_view kVelocityType = "vrpn_Tracker Velocity";
inline constexpr std::string_view kButtonType = "vrpn_Button Change";
inline constexpr std::string_view kAnalogType = "vrpn_Analog Channel";
inline constexpr std::string_view kForceType = "vrpn_ForceDevice Force";
inline constexpr std::string_view kPingType = "vrpn_Base ping_message";
inline constexpr std::string_view kPongType = "vrpn_Base pong_message";

using Payload = std::vector<std::byte>;

/// A description of a sender or type.
[[nodiscard]] Payload name_payload(std::string_view name);
[[nodiscard]] Payload pose_payload(std::int32_t sensor, const driver::Pose& pose);
/// @param span_s  the time in which the rotation is the quaternion of the payload
[[nodiscard]] Payload velocity_payload(std::int32_t sensor, const driver::Twist& twist,
                                       double span_s);
[[nodiscard]] Payload button_payload(std::int32_t button, bool is_pressed);
[[nodiscard]] Payload analog_payload(std::span<const float> channels);
[[nodiscard]] Payload force_payload(const driver::Vector3& force_newton);

struct SensorPose {
  std::int32_t sensor = 0;
  driver::Pose pose{};
};

/// The name of a description; nullopt if the payload is none.
[[nodiscard]] std::optional<std::string> read_name(ConstBytes payload);
/// nullopt if the payload has another size, or a number is not finite.
[[nodiscard]] std::optional<SensorPose> read_pose(ConstBytes payload) noexcept;

}  // namespace rtpm::vrpn
