#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <tuple>
#include <vector>

#include "rtpm/ros2/message.hpp"

namespace rtpm::ros2::test {

/// The messages that programs send and receive as such.
using Messages = std::tuple<Bool, CompressedImage, DiagnosticArray, Empty, Imu, JointState, Joy,
                            ParticipantEntitiesInfo, PoseStamped, String, TfMessage, TwistStamped,
                            WrenchStamped>;

/// Fills messages as others_messages.py does: numbers count up by one, below 100, and every second truth value
/// holds; a sequence has three elements.
class Filler {
 public:
  template <class T>
  void fill(T& value) {
    if constexpr (Message<T>) {
      T::fields(value, [this](std::string_view, auto& field) { fill(field); });
    } else if constexpr (std::is_same_v<T, std::string>) {
      value = "text " + std::to_string(number());
    } else if constexpr (requires { T::kSizeMax; }) {
      fill(value.text);
    } else if constexpr (std::is_same_v<T, bool>) {
      value = number() % 2 == 1;
    } else if constexpr (Number<T>) {
      value = static_cast<T>(number());
    } else {
      if constexpr (requires { value.resize(3); }) value.resize(3);
      for (auto& element : value)
        fill(element);
    }
  }

 private:
  [[nodiscard]] unsigned number() { return ++count_ % 100; }
  unsigned count_ = 0;
};

template <Message M>
M example() {
  M message;
  // The field that stands for none.
  if constexpr (!std::is_same_v<M, Empty>) Filler().fill(message);
  return message;
}

}  // namespace rtpm::ros2::test
