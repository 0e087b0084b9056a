#pragma once

#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::console {

/// Limits of a token that a user chooses.
inline constexpr std::size_t kTokenSizeMin = 16;
inline constexpr std::size_t kTokenSizeMax = 256;

/// Whether a user may choose this token.
[[nodiscard]] bool is_token(std::string_view text) noexcept;
inline constexpr std::string_view kTokenForm = "16 to 256 of A-Z a-z 0-9 - _ . ~";

/// A token of 192 random bits that fits a URL.
/// @errors   the system gives no random numbers
[[nodiscard]] expected<std::string, SetupError> make_token();

/// The token in the file `path`. Makes a missing file with a new token, for this user alone.
/// @errors   the file can't be read or made, other users may read it, or it has no token
[[nodiscard]] expected<std::string, SetupError> token_in_file(const std::string& path);

/// Whether the texts are equal, in a time that depends on their sizes only.
[[nodiscard]] bool is_same_token(std::string_view a, std::string_view b) noexcept;

}  // namespace rtpm::console
