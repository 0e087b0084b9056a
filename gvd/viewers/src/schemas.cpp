#include <CompressedImage_bfbs_generated.h>
#include <CompressedVideo_bfbs_generated.h>
#include <FrameTransforms_bfbs_generated.h>
#include <PoseInFrame_bfbs_generated.h>
#include <RawAudio_bfbs_generated.h>
#include <SceneUpdate_bfbs_generated.h>

#include <array>

#include "rtpm/viewers/messages.hpp"

namespace rtpm::viewers {
namespace {

template <class Binary>
ConstBytes bytes_of() noexcept {
  return std::as_bytes(std::span(Binary::data(), Binary::size()));
}

}  // namespace

Schema schema_of(Type type) noexcept {
  switch (type) {
    case Type::kPoseInFrame:
      return {"foxglove.PoseInFrame", bytes_of<foxglove::PoseInFrameBinarySchema>()};
    case Type::kFrameTransforms:
      return {"foxglove.FrameTransforms", bytes_of<foxglove::FrameTransformsBinarySchema>()};
    case Type::kSceneUpdate:
      return {"foxglove.SceneUpdate", bytes_of<foxglove::SceneUpdateBinarySchema>()};
    case Type::kCompressedVideo:
      return {"foxglove.CompressedVideo", bytes_of<foxglove::CompressedVideoBinarySchema>()};
    case Type::kCompressedImage:
      return {"foxglove.CompressedImage", bytes_of<foxglove::CompressedImageBinarySchema>()};
    case Type::kRawAudio:
      return {"foxglove.RawAudio", bytes_of<foxglove::RawAudioBinarySchema>()};
  }
  return {};
}

}  // namespace rtpm::viewers
