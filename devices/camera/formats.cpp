#include "formats.hpp"

#include <algorithm>
#include <string_view>

namespace rtpm::camerad {
namespace {

int number(const GstStructure& structure, const char* field) {
  int value = 0;
  static_cast<void>(gst_structure_get_int(&structure, field, &value));
  return std::max(value, 0);
}

}  // namespace

media::VideoFormatT video_format(const GstStructure& structure) {
  media::VideoFormatT format;
  const std::string_view type = gst_structure_get_name(&structure);
  format.codec = type == "image/jpeg" ? media::Codec::Jpeg : media::Codec::H264;
  format.width_px = static_cast<std::uint32_t>(number(structure, "width"));
  format.height_px = static_cast<std::uint32_t>(number(structure, "height"));
  int numerator = 0;
  int denominator = 0;
  if (gst_structure_get_fraction(&structure, "framerate", &numerator, &denominator) != FALSE &&
      denominator > 0) {
    format.rate_hz = static_cast<double>(numerator) / denominator;
  }
  return format;
}

media::SoundFormatT sound_format(const GstStructure& structure) {
  media::SoundFormatT format;
  const std::string_view type = gst_structure_get_name(&structure);
  format.codec = type == "audio/x-opus" ? media::Codec::Opus : media::Codec::PcmS16;
  format.sample_rate_hz = static_cast<std::uint32_t>(number(structure, "rate"));
  format.channel_count = static_cast<std::uint32_t>(number(structure, "channels"));
  return format;
}

std::string caps_text(const media::VideoFormatT& format) {
  std::string text;
  if (format.codec == media::Codec::H264)
    text = "video/x-h264, stream-format=byte-stream, alignment=au";
  if (format.codec == media::Codec::Jpeg) text = "image/jpeg";
  if (text.empty() || format.width_px == 0) return text;
  text += ", width=" + std::to_string(format.width_px);
  text += ", height=" + std::to_string(format.height_px);
  // In thousandths, which cover 29.97 Hz well enough.
  const auto rate = static_cast<std::uint64_t>(std::clamp(format.rate_hz, 0.0, 1e5) * 1000 + 0.5);
  return text + ", framerate=" + std::to_string(rate) + "/1000";
}

std::string caps_text(const media::SoundFormatT& format) {
  std::string text;
  if (format.codec == media::Codec::PcmS16) text = "audio/x-raw, format=S16LE, layout=interleaved";
  if (format.codec == media::Codec::Opus) text = "audio/x-opus, channel-mapping-family=0";
  if (text.empty() || format.sample_rate_hz == 0) return text;
  return text + ", rate=" + std::to_string(format.sample_rate_hz) +
         ", channels=" + std::to_string(format.channel_count);
}

}  // namespace rtpm::camerad
