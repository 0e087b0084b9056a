#pragma once

#include <filesystem>
#include <string>
#include <string_view>

/// RTPM's paths are UTF-8 on every system; those of std::filesystem are the system's own.
namespace rtpm::inline base {

[[nodiscard]] inline std::filesystem::path path_of_utf8(std::string_view text) {
  return std::u8string(text.begin(), text.end());
}
[[nodiscard]] inline std::string utf8_of(const std::filesystem::path& path) {
  const std::u8string text = path.u8string();
  return {text.begin(), text.end()};
}

}  // namespace rtpm::inline base
