#include "rtpm/viewers/messages.hpp"

#include <CompressedImage_generated.h>
#include <CompressedVideo_generated.h>
#include <FrameTransforms_generated.h>
#include <PoseInFrame_generated.h>
#include <RawAudio_generated.h>

#include "builder.hpp"

namespace rtpm::viewers {
namespace {

Bytes bytes_in(Builder& builder, ConstBytes data) {
  return builder.CreateVector(
      static_cast<const std::uint8_t*>(static_cast<const void*>(data.data())), data.size());
}

}  // namespace

Message pose_message(const Stamp& stamp, const driver::Pose& pose) {
  Builder builder;
  const foxglove::Time time = time_of(stamp.time_ns);
  const auto frame = text_in(builder, stamp.frame);
  const auto place = pose_in(builder, pose);
  return finished(builder, foxglove::CreatePoseInFrame(builder, &time, frame, place));
}

Message transform_message(const Stamp& stamp, std::string_view child, const driver::Pose& pose) {
  Builder builder;
  const foxglove::Time time = time_of(stamp.time_ns);
  const driver::Quaternion& turn = pose.orientation;
  const auto parent_frame = text_in(builder, stamp.frame);
  const auto child_frame = text_in(builder, child);
  const auto translation = vector_in(builder, pose.position_m);
  const auto rotation = foxglove::CreateQuaternion(builder, turn.x, turn.y, turn.z, turn.w);
  const auto transform = foxglove::CreateFrameTransform(builder, &time, parent_frame, child_frame,
                                                        translation, rotation);
  const auto list = builder.CreateVector(&transform, 1);
  return finished(builder, foxglove::CreateFrameTransforms(builder, list));
}

Message video_message(const Stamp& stamp, std::string_view format, ConstBytes data) {
  Builder builder(data.size() + 256);
  const foxglove::Time time = time_of(stamp.time_ns);
  const auto frame = text_in(builder, stamp.frame);
  const auto bytes = bytes_in(builder, data);
  const auto name = text_in(builder, format);
  return finished(builder, foxglove::CreateCompressedVideo(builder, &time, frame, bytes, name));
}

Message image_message(const Stamp& stamp, std::string_view format, ConstBytes data) {
  Builder builder(data.size() + 256);
  const foxglove::Time time = time_of(stamp.time_ns);
  const auto frame = text_in(builder, stamp.frame);
  const auto bytes = bytes_in(builder, data);
  const auto name = text_in(builder, format);
  return finished(builder, foxglove::CreateCompressedImage(builder, &time, frame, bytes, name));
}

Message audio_message(std::uint64_t time_ns, ConstBytes data, std::uint32_t sample_rate_hz,
                      std::uint32_t channel_count) {
  Builder builder(data.size() + 256);
  const foxglove::Time time = time_of(time_ns);
  const auto bytes = bytes_in(builder, data);
  const auto format = text_in(builder, "pcm-s16");
  return finished(builder, foxglove::CreateRawAudio(builder, &time, bytes, format, sample_rate_hz,
                                                    channel_count));
}

}  // namespace rtpm::viewers
