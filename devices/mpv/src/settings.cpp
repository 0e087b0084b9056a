#include "rtpm/device_mpv/settings.hpp"

#include <utility>

#include "rtpm/device_io/words.hpp"

namespace rtpm::device_mpv {
namespace {

unexpected<SetupError> refusal(std::string what) {
  return setup_error(std::move(what), "",
                     "give 'file=CLIP', 'headless=yes file=CLIP' or 'socket=PATH'");
}

}  // namespace

expected<Settings, SetupError> read_settings(std::string_view words) {
  const auto read = device_io::read_words(
      "mpv", words, {.names = {"headless"}, .names_to_the_end = {"file", "socket"}});
  if (!read) return refusal(read.error().what);
  const auto value = [&](std::string_view name) {
    const auto found = read->find(name);
    return found == read->end() ? std::string() : found->second;
  };
  const std::string headless = value("headless");
  if (headless != "" && headless != "yes" && headless != "no") {
    return refusal("the driver mpv was told headless=" + headless);
  }
  Settings settings{
      .file = value("file"), .socket = value("socket"), .is_headless = headless == "yes"};
  if (settings.file.empty() && settings.socket.empty()) {
    return refusal("the driver mpv was told neither a file nor a socket");
  }
  if (settings.is_headless && !settings.socket.empty()) {
    return refusal("the driver mpv can't make a running player headless");
  }
  return settings;
}

}  // namespace rtpm::device_mpv
