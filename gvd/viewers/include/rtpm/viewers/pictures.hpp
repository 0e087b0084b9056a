#pragma once

#include <cstdint>
#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/viewers/messages.hpp"

namespace rtpm::viewers {

/// The content of a kRawAudio message.
/// @ownership refers to the message
struct Sound {
  ConstBytes data{};
  std::uint32_t sample_rate_hz = 0;
  std::uint32_t channel_count = 0;
};

/// The picture of a kCompressedVideo or kCompressedImage message; nullopt if the message, which may
/// be anybody's, is no such table.
/// @threads  any
[[nodiscard]] std::optional<ConstBytes> picture_in(Type type, ConstBytes message) noexcept;
/// Likewise the sound of a kRawAudio message.
[[nodiscard]] std::optional<Sound> sound_in(ConstBytes message) noexcept;

}  // namespace rtpm::viewers
