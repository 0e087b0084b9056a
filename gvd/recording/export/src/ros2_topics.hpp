#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/recording/file_writer.hpp"
#include "rtpm/ros2/message.hpp"

namespace rtpm::exports {

/// Whether a subscriber that joins late gets the last message.
enum class Durability : std::uint8_t { kVolatile, kTransientLocal };

/// The topics of a recording of ROS 2.
class Ros2Topics {
 public:
  explicit Ros2Topics(recording::FileWriter& writer) noexcept : writer_(writer) {}

  /// Adds a topic for messages M, or finds it.
  /// @param origin  the source, which another topic of the same name may not have
  /// @errors   the other origin of this name
  template <ros2::Message M>
  [[nodiscard]] expected<std::uint16_t, std::string> add(const std::string& name,
                                                         const std::string& origin,
                                                         Durability durability) {
    return add(name, origin, durability,
               {.name = std::string(M::kType), .encoding = "ros2msg", .data = bytes_of<M>()},
               ros2::type_hash<M>());
  }

  /// Writes a message at the times of `source`.
  template <ros2::Message M>
  [[nodiscard]] expected<void, SetupError> write(std::uint16_t topic, const M& message,
                                                 const recording::Message& source) {
    ros2::encode(message, buffer_);
    recording::Message converted = source;
    converted.channel_id = topic;
    converted.data = buffer_;
    return writer_.write(converted);
  }
  [[nodiscard]] std::size_t size() const noexcept { return topics_.size(); }

 private:
  struct Known {
    std::string origin;
    std::uint16_t channel = 0;
  };

  template <ros2::Message M>
  static std::vector<std::byte> bytes_of() {
    const std::string text = ros2::definition<M>();
    const auto bytes = std::as_bytes(std::span(text));
    return {bytes.begin(), bytes.end()};
  }
  [[nodiscard]] expected<std::uint16_t, std::string> add(const std::string& name,
                                                         const std::string& origin,
                                                         Durability durability,
                                                         const recording::Schema& schema,
                                                         const std::string& type_hash);

  recording::FileWriter& writer_;
  std::map<std::string, Known> topics_{};
  std::vector<std::byte> buffer_{};
};

}  // namespace rtpm::exports
