#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

/// The messages of ROS 2 that RTPM reads and writes. `fields()` is a message's only description: its
/// encoding, its definition as text and its type hash follow from it (message.hpp).
/// @source   ROS 2 common_interfaces, geometry2, rcl_interfaces, rmw_dds_common
namespace rtpm::ros2 {

/// A text of at most `size_max` bytes.
template <std::size_t size_max>
struct BoundedText {
  static constexpr std::size_t kSizeMax = size_max;
  std::string text{};
};

/// Since 1970 in UTC.
struct Time {
  static constexpr std::string_view kType = "builtin_interfaces/msg/Time";
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
  static void fields(auto& self, auto&& visit) {
    visit("sec", self.sec);
    visit("nanosec", self.nanosec);
  }
};

struct Header {
  static constexpr std::string_view kType = "std_msgs/msg/Header";
  Time stamp{};
  std::string frame_id{};
  static void fields(auto& self, auto&& visit) {
    visit("stamp", self.stamp);
    visit("frame_id", self.frame_id);
  }
};

struct Bool {
  static constexpr std::string_view kType = "std_msgs/msg/Bool";
  bool data = false;
  static void fields(auto& self, auto&& visit) { visit("data", self.data); }
};

struct String {
  static constexpr std::string_view kType = "std_msgs/msg/String";
  std::string data{};
  static void fields(auto& self, auto&& visit) { visit("data", self.data); }
};

/// The name of the field that IDL demands of an empty message.
inline constexpr std::string_view kEmptyField = "structure_needs_at_least_one_member";

struct Empty {
  static constexpr std::string_view kType = "std_msgs/msg/Empty";
  std::uint8_t filler = 0;
  static void fields(auto& self, auto&& visit) { visit(kEmptyField, self.filler); }
};

struct Vector3 {
  static constexpr std::string_view kType = "geometry_msgs/msg/Vector3";
  double x = 0;
  double y = 0;
  double z = 0;
  static void fields(auto& self, auto&& visit) {
    visit("x", self.x);
    visit("y", self.y);
    visit("z", self.z);
  }
};

struct Point {
  static constexpr std::string_view kType = "geometry_msgs/msg/Point";
  double x = 0;
  double y = 0;
  double z = 0;
  static void fields(auto& self, auto&& visit) {
    visit("x", self.x);
    visit("y", self.y);
    visit("z", self.z);
  }
};

struct Quaternion {
  static constexpr std::string_view kType = "geometry_msgs/msg/Quaternion";
  double x = 0;
  double y = 0;
  double z = 0;
  double w = 1;
  static void fields(auto& self, auto&& visit) {
    visit("x", self.x);
    visit("y", self.y);
    visit("z", self.z);
    visit("w", self.w);
  }
};

struct Pose {
  static constexpr std::string_view kType = "geometry_msgs/msg/Pose";
  Point position{};
  Quaternion orientation{};
  static void fields(auto& self, auto&& visit) {
    visit("position", self.position);
    visit("orientation", self.orientation);
  }
};

struct PoseStamped {
  static constexpr std::string_view kType = "geometry_msgs/msg/PoseStamped";
  Header header{};
  Pose pose{};
  static void fields(auto& self, auto&& visit) {
    visit("header", self.header);
    visit("pose", self.pose);
  }
};

struct Twist {
  static constexpr std::string_view kType = "geometry_msgs/msg/Twist";
  Vector3 linear{};
  Vector3 angular{};
  static void fields(auto& self, auto&& visit) {
    visit("linear", self.linear);
    visit("angular", self.angular);
  }
};

struct TwistStamped {
  static constexpr std::string_view kType = "geometry_msgs/msg/TwistStamped";
  Header header{};
  Twist twist{};
  static void fields(auto& self, auto&& visit) {
    visit("header", self.header);
    visit("twist", self.twist);
  }
};

struct Wrench {
  static constexpr std::string_view kType = "geometry_msgs/msg/Wrench";
  Vector3 force{};
  Vector3 torque{};
  static void fields(auto& self, auto&& visit) {
    visit("force", self.force);
    visit("torque", self.torque);
  }
};

struct WrenchStamped {
  static constexpr std::string_view kType = "geometry_msgs/msg/WrenchStamped";
  Header header{};
  Wrench wrench{};
  static void fields(auto& self, auto&& visit) {
    visit("header", self.header);
    visit("wrench", self.wrench);
  }
};

struct Transform {
  static constexpr std::string_view kType = "geometry_msgs/msg/Transform";
  Vector3 translation{};
  Quaternion rotation{};
  static void fields(auto& self, auto&& visit) {
    visit("translation", self.translation);
    visit("rotation", self.rotation);
  }
};

struct TransformStamped {
  static constexpr std::string_view kType = "geometry_msgs/msg/TransformStamped";
  Header header{};
  std::string child_frame_id{};
  Transform transform{};
  static void fields(auto& self, auto&& visit) {
    visit("header", self.header);
    visit("child_frame_id", self.child_frame_id);
    visit("transform", self.transform);
  }
};

struct TfMessage {
  static constexpr std::string_view kType = "tf2_msgs/msg/TFMessage";
  std::vector<TransformStamped> transforms{};
  static void fields(auto& self, auto&& visit) { visit("transforms", self.transforms); }
};

struct JointState {
  static constexpr std::string_view kType = "sensor_msgs/msg/JointState";
  Header header{};
  std::vector<std::string> name{};
  std::vector<double> position{};
  std::vector<double> velocity{};
  std::vector<double> effort{};
  static void fields(auto& self, auto&& visit) {
    visit("header", self.header);
    visit("name", self.name);
    visit("position", self.position);
    visit("velocity", self.velocity);
    visit("effort", self.effort);
  }
};

struct Joy {
  static constexpr std::string_view kType = "sensor_msgs/msg/Joy";
  Header header{};
  std::vector<float> axes{};
  std::vector<std::int32_t> buttons{};
  static void fields(auto& self, auto&& visit) {
    visit("header", self.header);
    visit("axes", self.axes);
    visit("buttons", self.buttons);
  }
};

struct Imu {
  static constexpr std::string_view kType = "sensor_msgs/msg/Imu";
  Header header{};
  Quaternion orientation{};
  /// All zero: unknown. The first is -1: there is no such measurement. Likewise below.
  std::array<double, 9> orientation_covariance{};
  Vector3 angular_velocity{};
  std::array<double, 9> angular_velocity_covariance{};
  Vector3 linear_acceleration{};
  std::array<double, 9> linear_acceleration_covariance{};
  static void fields(auto& self, auto&& visit) {
    visit("header", self.header);
    visit("orientation", self.orientation);
    visit("orientation_covariance", self.orientation_covariance);
    visit("angular_velocity", self.angular_velocity);
    visit("angular_velocity_covariance", self.angular_velocity_covariance);
    visit("linear_acceleration", self.linear_acceleration);
    visit("linear_acceleration_covariance", self.linear_acceleration_covariance);
  }
};

/// A picture, compressed as `format` says: "jpeg", "png", and "h264" of programs that know it.
struct CompressedImage {
  static constexpr std::string_view kType = "sensor_msgs/msg/CompressedImage";
  Header header{};
  std::string format{};
  std::vector<std::uint8_t> data{};
  static void fields(auto& self, auto&& visit) {
    visit("header", self.header);
    visit("format", self.format);
    visit("data", self.data);
  }
};

struct KeyValue {
  static constexpr std::string_view kType = "diagnostic_msgs/msg/KeyValue";
  std::string key{};
  std::string value{};
  static void fields(auto& self, auto&& visit) {
    visit("key", self.key);
    visit("value", self.value);
  }
};

struct DiagnosticStatus {
  static constexpr std::string_view kType = "diagnostic_msgs/msg/DiagnosticStatus";
  static constexpr std::byte kOk{0};
  static constexpr std::byte kWarn{1};
  static constexpr std::byte kError{2};
  static constexpr std::byte kStale{3};
  std::byte level = kOk;
  std::string name{};
  std::string message{};
  std::string hardware_id{};
  std::vector<KeyValue> values{};
  static void fields(auto& self, auto&& visit) {
    visit("level", self.level);
    visit("name", self.name);
    visit("message", self.message);
    visit("hardware_id", self.hardware_id);
    visit("values", self.values);
  }
};

struct DiagnosticArray {
  static constexpr std::string_view kType = "diagnostic_msgs/msg/DiagnosticArray";
  Header header{};
  std::vector<DiagnosticStatus> status{};
  static void fields(auto& self, auto&& visit) {
    visit("header", self.header);
    visit("status", self.status);
  }
};

/// The identity of an endpoint or participant, as ROS 2 Iron and later have it.
struct Gid {
  static constexpr std::string_view kType = "rmw_dds_common/msg/Gid";
  std::array<std::uint8_t, 16> data{};
  static void fields(auto& self, auto&& visit) { visit("data", self.data); }
};

struct NodeEntitiesInfo {
  static constexpr std::string_view kType = "rmw_dds_common/msg/NodeEntitiesInfo";
  BoundedText<256> node_namespace{};
  BoundedText<256> node_name{};
  std::vector<Gid> reader_gid_seq{};
  std::vector<Gid> writer_gid_seq{};
  static void fields(auto& self, auto&& visit) {
    visit("node_namespace", self.node_namespace);
    visit("node_name", self.node_name);
    visit("reader_gid_seq", self.reader_gid_seq);
    visit("writer_gid_seq", self.writer_gid_seq);
  }
};

/// The endpoints of a program's nodes; the topic is `ros_discovery_info`.
struct ParticipantEntitiesInfo {
  static constexpr std::string_view kType = "rmw_dds_common/msg/ParticipantEntitiesInfo";
  Gid gid{};
  std::vector<NodeEntitiesInfo> node_entities_info_seq{};
  static void fields(auto& self, auto&& visit) {
    visit("gid", self.gid);
    visit("node_entities_info_seq", self.node_entities_info_seq);
  }
};

}  // namespace rtpm::ros2
