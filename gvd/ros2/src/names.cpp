#include "rtpm/ros2/names.hpp"

namespace rtpm::ros2 {
namespace {

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}
bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

}  // namespace

std::string ros_name(std::string_view name) {
  std::string result;
  bool is_first = true;
  for (const char c : name) {
    if (c == '/') {
      is_first = true;
      continue;
    }
    if (is_first && !result.empty()) result += '/';
    if (is_first && is_digit(c)) result += '_';
    result += is_letter(c) || is_digit(c) ? c : '_';
    is_first = false;
  }
  return result;
}

std::string topic_name(std::string_view device, std::string_view subject) {
  return "/rtpm/" + ros_name(device) + "/" + std::string(subject);
}

expected<std::string, SetupError> GivenNames::give(std::string_view name) {
  std::string given = ros_name(name);
  // Leaves space for the folder and the longest subject.
  constexpr std::size_t kSizeMax =
      kTopicSizeMax - std::string_view("/rtpm//command/wrench/").size();
  if (given.empty() || given.size() > kSizeMax) {
    return setup_error("'" + std::string(name) + "' can't be named in ROS 2",
                       given.empty() ? "nothing of it is left"
                                     : "it has more than " + std::to_string(kSizeMax) + " bytes",
                       "give it another name");
  }
  const auto [found, is_new] = origins_.try_emplace(given, name);
  if (is_new || found->second == name) return given;
  return setup_error("'" + found->second + "' and '" + std::string(name) +
                         "' have the same name in ROS 2, '" + given + "'",
                     "", "rename one of them");
}

std::string dds_type(std::string_view type) {
  const std::size_t slash = type.rfind('/');
  std::string result;
  for (const char c : type.substr(0, slash))
    result += c == '/' ? std::string("::") : std::string(1, c);
  return result + "::dds_::" + std::string(type.substr(slash + 1)) + "_";
}

}  // namespace rtpm::ros2
