#include "pipeline_error.hpp"

#include <array>
#include <utility>

#include "gstreamer.hpp"

namespace rtpm::camerad {
namespace {

constexpr std::array<std::pair<std::string_view, std::string_view>, 21> kPackages{
    {{"x264enc", "plugins-ugly"},      {"v4l2src", "plugins-good"},
     {"jpegenc", "plugins-good"},      {"pulsesrc", "pulseaudio"},
     {"udpsrc", "plugins-good"},       {"rtspsrc", "plugins-good"},
     {"autovideosrc", "plugins-good"}, {"autoaudiosrc", "plugins-good"},
     {"vp8enc", "plugins-good"},       {"alsasrc", "alsa"},
     {"opusenc", "plugins-base"},      {"videoconvert", "plugins-base"},
     {"audioconvert", "plugins-base"}, {"videotestsrc", "plugins-base"},
     {"audiotestsrc", "plugins-base"}, {"h264parse", "plugins-bad"},
     {"openh264enc", "plugins-bad"},   {"vah264enc", "plugins-bad"},
     {"libcamerasrc", "libcamera"},    {"pipewiresrc", "pipewire"},
     {"appsrc", "plugins-base"}}};

/// The element that 'no element "x264enc"' names; empty if the text is another.
std::string missing_element(std::string_view text) {
  const std::size_t begin = text.find('"');
  const std::size_t end = text.rfind('"');
  if (begin == std::string_view::npos || end <= begin) return {};
  return std::string(text.substr(begin + 1, end - begin - 1));
}

}  // namespace

std::string package_of(std::string_view element) {
  for (const auto& [name, package] : kPackages) {
    if (name == element) return "gstreamer1.0-" + std::string(package);
  }
  if (element.starts_with("avenc_") || element.starts_with("avdec_")) return "gstreamer1.0-libav";
  return {};
}

SetupError parse_error(const GError& error) {
  if (g_error_matches(&error, GST_PARSE_ERROR, GST_PARSE_ERROR_NO_SUCH_ELEMENT) == FALSE) {
    return {"its pipeline's text is wrong", error.message,
            "correct it; gst-launch-1.0 takes the same text"};
  }
  const std::string element = missing_element(error.message);
  const std::string package = package_of(element);
  return {"its pipeline has the element " + element, "GStreamer here has none of that name",
          package.empty() ? "correct the name, or find its Debian package by apt-cache search "
                            "gstreamer1.0"
                          : "install the Debian package " + package};
}

SetupError run_error(GstMessage& message) {
  GError* parsed = nullptr;
  char* details = nullptr;
  gst_message_parse_error(&message, &parsed, &details);
  const Owned<GError> error(parsed);
  const std::string more = text_of(details);
  const std::string element = text_of(gst_object_get_name(GST_MESSAGE_SRC(&message)));
  std::string why = error->message;
  // The last line has the cause, behind file, line and function.
  if (const std::size_t line = more.rfind('\n'); line != std::string::npos && !more.empty())
    why += " (" + more.substr(line + 1) + ")";
  return {"the element " + element + " failed", std::move(why),
          "check its device and its properties; the pipeline is tried again"};
}

}  // namespace rtpm::camerad
