#pragma once

#include <Geometry_generated.h>

#include <algorithm>
#include <cstdint>
#include <string_view>

#include "rtpm/base/bytes.hpp"
#include "rtpm/driver/geometry.hpp"
#include "rtpm/viewers/messages.hpp"

/// The parts that Foxglove's messages have in common.
namespace rtpm::viewers {

using Builder = flatbuffers::FlatBufferBuilder;
template <class T>
using Made = flatbuffers::Offset<T>;
using Bytes = flatbuffers::Offset<flatbuffers::Vector<std::uint8_t>>;

inline constexpr std::uint64_t kNsPerSecond = 1'000'000'000;

inline foxglove::Time time_of(std::uint64_t ns) noexcept {
  return {static_cast<std::uint32_t>(ns / kNsPerSecond),
          static_cast<std::uint32_t>(ns % kNsPerSecond)};
}

inline Made<flatbuffers::String> text_in(Builder& builder, std::string_view text) {
  return builder.CreateString(text.data(), text.size());
}

inline Made<foxglove::Vector3> vector_in(Builder& builder, const driver::Vector3& vector) {
  return foxglove::CreateVector3(builder, vector.x, vector.y, vector.z);
}

inline Made<foxglove::Pose> pose_in(Builder& builder, const driver::Pose& pose) {
  const driver::Quaternion& turn = pose.orientation;
  const auto position = vector_in(builder, pose.position_m);
  return foxglove::CreatePose(builder, position,
                              foxglove::CreateQuaternion(builder, turn.x, turn.y, turn.z, turn.w));
}

template <class Root>
Message finished(Builder& builder, Made<Root> root) {
  builder.Finish(root);
  const auto bytes = std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize()));
  return {bytes.begin(), bytes.end()};
}

}  // namespace rtpm::viewers
