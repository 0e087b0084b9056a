#include "rtpm/device_mpv/settings.hpp"

#include <algorithm>

namespace rtpm::device_mpv {
namespace {

/// Cuts the first word off.
std::string_view next_word(std::string_view& words) {
  const std::size_t begin = std::min(words.find_first_not_of(' '), words.size());
  words.remove_prefix(begin);
  const std::string_view word = words.substr(0, words.find(' '));
  return word;
}

unexpected<SetupError> refusal(const std::string& what) {
  return setup_error(what, "", "give 'file=CLIP', 'headless=yes file=CLIP' or 'socket=PATH'");
}

}  // namespace

expected<Settings, SetupError> read_settings(std::string_view words) {
  Settings settings;
  while (true) {
    const std::string_view word = next_word(words);
    if (word.empty()) break;
    if (word.starts_with("file=")) {
      settings.file = words.substr(5);
      break;
    }
    if (word.starts_with("socket=")) {
      settings.socket = words.substr(7);
      break;
    }
    if (word != "headless=yes" && word != "headless=no") {
      return refusal("mpv's driver does not know the word '" + std::string(word) + "'");
    }
    settings.is_headless = word == "headless=yes";
    words.remove_prefix(word.size());
  }
  if (settings.file.empty() && settings.socket.empty()) {
    return refusal("mpv's driver was told neither a file nor a socket");
  }
  if (settings.is_headless && !settings.socket.empty()) {
    return refusal("mpv's driver can't make a running player headless");
  }
  return settings;
}

}  // namespace rtpm::device_mpv
