#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

/// Types of messages as data.
/// @source   ROS 2 rcl_interfaces, type_description_interfaces/msg/FieldType; REP 2011
namespace rtpm::ros2 {

// Numbers of FieldType.msg; an array's or a sequence's is its element's plus one of the latter.
inline constexpr std::uint8_t kNestedType = 1;
inline constexpr std::uint8_t kTextType = 17;
inline constexpr std::uint8_t kBoundedTextType = 21;
inline constexpr std::uint8_t kArray = 48;
inline constexpr std::uint8_t kSequence = 144;

template <class T>
inline constexpr std::uint8_t kNumberType = std::uint8_t{};
template <>
inline constexpr std::uint8_t kNumberType<std::uint8_t> = 3;
template <>
inline constexpr std::uint8_t kNumberType<std::int32_t> = 6;
template <>
inline constexpr std::uint8_t kNumberType<std::uint32_t> = 7;
template <>
inline constexpr std::uint8_t kNumberType<float> = 10;
template <>
inline constexpr std::uint8_t kNumberType<double> = 11;
template <>
inline constexpr std::uint8_t kNumberType<bool> = 15;
template <>
inline constexpr std::uint8_t kNumberType<std::byte> = 16;

struct FieldType {
  std::uint8_t type_id = 0;
  std::size_t capacity = 0;       ///< The size of an array.
  std::size_t text_capacity = 0;  ///< The most bytes of a bounded text.
  std::string_view nested{};      ///< The name of a message.
};

struct Field {
  std::string_view name;
  FieldType type;
};

struct TypeDescription {
  std::string_view name;  ///< "geometry_msgs/msg/Pose".
  std::vector<Field> fields;
};

/// @param types  the message, then those that it contains, by name
[[nodiscard]] std::string definition_of(const std::vector<TypeDescription>& types);
/// @param types  as above
[[nodiscard]] std::string type_hash_of(const std::vector<TypeDescription>& types);

}  // namespace rtpm::ros2
