#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace rtpm::names {

/// The URLs of registries that share their names: "rtpm://a:7420/rtpm/names,rtpm://b:…". A comma
/// within a URL separates the hosts of one registry.
/// @threads  any
/// @realtime set-up only
[[nodiscard]] inline std::vector<std::string> registries_of(std::string_view text) {
  std::vector<std::string> urls;
  for (std::size_t begin = 0;;) {
    const std::size_t comma = text.find(",rtpm://", begin);
    urls.emplace_back(text.substr(begin, comma - begin));
    if (comma == std::string_view::npos) return urls;
    begin = comma + 1;
  }
}

}  // namespace rtpm::names
