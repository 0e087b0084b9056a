#pragma once

#include <map>
#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"

/// Names of ROS 2 for those of RTPM.
/// @source   ROS 2 design, "Topic and Service name mapping to DDS"
namespace rtpm::ros2 {

/// The bytes of a topic's name at most; DDS's name has eight more.
inline constexpr std::size_t kTopicSizeMax = 247;

/// The relative name "lab/arm_0/_3dof" for "lab/arm-0/3dof": letters, digits and underscores, and no
/// token begins with a digit. Empty tokens are left out.
[[nodiscard]] std::string ros_name(std::string_view name);

/// "/rtpm/lab/arm0/pose", for "lab/arm0" and "pose".
[[nodiscard]] std::string topic_name(std::string_view device, std::string_view subject);

/// The names given so far, because two of RTPM's can become the same.
class GivenNames {
 public:
  /// Gives ros_name(name).
  /// @errors   another name became the same, nothing is left of the name, or it is too long
  [[nodiscard]] expected<std::string, SetupError> give(std::string_view name);

 private:
  std::map<std::string, std::string> origins_{};
};

/// The DDS type "geometry_msgs::msg::dds_::Pose_", for "geometry_msgs/msg/Pose".
[[nodiscard]] std::string dds_type(std::string_view type);

}  // namespace rtpm::ros2
