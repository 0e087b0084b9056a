#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace rtpm::options {

/// " (did you mean 'port'?)", or nothing if no candidate resembles `word`.
/// @realtime set-up only
[[nodiscard]] std::string suggestion(std::string_view word,
                                     const std::vector<std::string>& candidates);

}  // namespace rtpm::options
