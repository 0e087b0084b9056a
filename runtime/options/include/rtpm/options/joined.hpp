#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace rtpm::options {

/// The texts with a separator between them: "a, b".
/// @realtime set-up only
[[nodiscard]] std::string joined(const std::vector<std::string>& texts,
                                 std::string_view separator = ", ");

}  // namespace rtpm::options
