#pragma once

#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::console {

/// Shortest token that a user may choose.
inline constexpr std::size_t kTokenSizeMin = 16;

/// A token of 192 random bits that fits a URL.
/// @errors   the system gives no random numbers
[[nodiscard]] expected<std::string, SetupError> make_token();

/// Whether the texts are equal, in a time that depends on their sizes only.
[[nodiscard]] bool is_same_token(std::string_view a, std::string_view b) noexcept;

}  // namespace rtpm::console
