#include "rtpm/device_mpv/settings.hpp"

#include <utility>

#include "rtpm/driver/arguments.hpp"

namespace rtpm::device_mpv {
namespace {

unexpected<SetupError> refusal(std::string what) {
  return setup_error(std::move(what), "",
                     "give 'file=CLIP', 'headless=yes file=CLIP' or 'socket=PATH'");
}

}  // namespace

expected<Settings, SetupError> read_settings(std::string_view words) {
  const auto read = driver::read_words(
      "mpv", words, {.names = {"headless"}, .names_to_the_end = {"file", "socket"}});
  if (!read) return refusal(read.error().what);
  const std::string headless = driver::value_of(*read, "headless");
  if (!headless.empty() && headless != "yes" && headless != "no") {
    return refusal("the driver mpv was told headless=" + headless);
  }
  Settings settings{.file = driver::value_of(*read, "file"),
                    .socket = driver::value_of(*read, "socket"),
                    .is_headless = headless == "yes"};
  if (settings.file.empty() && settings.socket.empty()) {
    return refusal("the driver mpv was told neither a file nor a socket");
  }
  if (settings.is_headless && !settings.socket.empty()) {
    return refusal("the driver mpv can't make a running player headless");
  }
  return settings;
}

}  // namespace rtpm::device_mpv
