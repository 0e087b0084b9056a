#pragma once

#include <gst/gst.h>

#include <string>

#include "rtpm/media/medium_server.hpp"

namespace rtpm::camerad {

/// The caps of pictures and of sound that a medium can have.
inline constexpr const char* kVideoCaps =
    "video/x-h264, stream-format=byte-stream, alignment=au; image/jpeg";
inline constexpr const char* kSoundCaps =
    "audio/x-raw, format=S16LE, layout=interleaved; audio/x-opus";

/// The format that fixed caps of these describe.
[[nodiscard]] media::VideoFormatT video_format(const GstStructure& structure);
[[nodiscard]] media::SoundFormatT sound_format(const GstStructure& structure);
/// The caps of a format, for gst_caps_from_string(); empty if the codec is not known.
[[nodiscard]] std::string caps_text(const media::VideoFormatT& format);
[[nodiscard]] std::string caps_text(const media::SoundFormatT& format);

/// The bytes of a buffer while this lives.
class Mapped {
 public:
  explicit Mapped(GstBuffer& buffer) : buffer_(buffer) {
    is_mapped_ = gst_buffer_map(&buffer_, &map_, GST_MAP_READ) != FALSE;
  }
  Mapped(const Mapped&) = delete;
  Mapped& operator=(const Mapped&) = delete;
  ~Mapped() {
    if (is_mapped_) gst_buffer_unmap(&buffer_, &map_);
  }
  [[nodiscard]] ConstBytes bytes() const noexcept {
    return is_mapped_ ? std::as_bytes(std::span(map_.data, map_.size)) : ConstBytes{};
  }

 private:
  GstBuffer& buffer_;
  GstMapInfo map_{};
  bool is_mapped_ = false;
};

/// The duration of a buffer; 0 if it has none.
[[nodiscard]] inline Duration duration_of(const GstBuffer& buffer) noexcept {
  const GstClockTime duration = GST_BUFFER_DURATION(&buffer);
  return GST_CLOCK_TIME_IS_VALID(duration) ? Duration{static_cast<std::int64_t>(duration)}
                                           : Duration{};
}

}  // namespace rtpm::camerad
