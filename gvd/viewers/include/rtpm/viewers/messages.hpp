#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/driver/geometry.hpp"
#include "rtpm/models/model.hpp"

/// Messages that Foxglove and Lichtblick draw: FlatBuffers of Foxglove's own schemas, which such
/// viewers recognise by their names.
/// @source   https://github.com/foxglove/foxglove-sdk, schemas/flatbuffer
namespace rtpm::viewers {

enum class Type : std::uint8_t {
  kPoseInFrame,
  kFrameTransforms,
  kSceneUpdate,
  kCompressedVideo,
  kCompressedImage,
  kRawAudio,
};

/// The schema of a type of messages.
struct Schema {
  std::string_view name{};  ///< "foxglove.PoseInFrame".
  ConstBytes reflection{};  ///< The content of a .bfbs, with the type as its root.
};

/// @threads  any
[[nodiscard]] Schema schema_of(Type type) noexcept;

/// A finished FlatBuffer.
using Message = std::vector<std::byte>;

/// When and where.
struct Stamp {
  std::uint64_t time_ns = 0;  ///< Since 1970 in UTC.
  std::string_view
      frame{};  ///< The frame of positions; a camera has its optical centre, z into the image.
};

/// The length of the arrow of a force.
inline constexpr double kArrowMetrePerNewton = 0.01;

/// A scene of one device: its force as an arrow, its local models as shapes.
struct Scene {
  std::string_view device{};
  driver::Vector3 position_m{};  ///< The arrow's tail.
  driver::Vector3 force_newton{};
  std::span<const gvd::Model> models{};
  driver::Vector3 low_m{};  ///< The workspace, over which planes are drawn.
  driver::Vector3 high_m{};
  std::uint64_t lifetime_ns = 0;  ///< After it viewers remove the scene.
};

/// foxglove.PoseInFrame.
[[nodiscard]] Message pose_message(const Stamp& stamp, const driver::Pose& pose);
/// foxglove.FrameTransforms, with the place of the frame `child` in the stamp's frame.
[[nodiscard]] Message transform_message(const Stamp& stamp, std::string_view child,
                                        const driver::Pose& pose);
/// foxglove.SceneUpdate, with the entities "DEVICE/force" and "DEVICE/models". Friction and detents
/// of a dial have no shape.
[[nodiscard]] Message scene_message(const Stamp& stamp, const Scene& scene);

/// foxglove.CompressedVideo: one frame.
/// @param format  "h264": Annex B, key frames with their parameter sets, no B frames; "h265", "vp9",
///                "av1"
[[nodiscard]] Message video_message(const Stamp& stamp, std::string_view format, ConstBytes data);
/// foxglove.CompressedImage.
/// @param format  "jpeg", "png", "webp"
[[nodiscard]] Message image_message(const Stamp& stamp, std::string_view format, ConstBytes data);
/// foxglove.RawAudio: interleaved little-endian 16-bit samples.
/// @param time_ns  of the first sample
[[nodiscard]] Message audio_message(std::uint64_t time_ns, ConstBytes data,
                                    std::uint32_t sample_rate_hz, std::uint32_t channel_count);

}  // namespace rtpm::viewers
