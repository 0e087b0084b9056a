#pragma once

#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::console {

/// Size limits of a token that a user chooses.
inline constexpr std::size_t kTokenSizeMin = 16;
inline constexpr std::size_t kTokenSizeMax = 256;

/// Whether a user may choose this token.
[[nodiscard]] bool is_token(std::string_view text) noexcept;
inline constexpr std::string_view kTokenForm = "16 to 256 of A-Z a-z 0-9 - _ . ~";

/// Creates a token of 192 random bits that can be part of a URL.
/// @errors   the system provides no random numbers
[[nodiscard]] expected<std::string, SetupError> make_token();

/// Reads the token in the file `path`. Creates a missing file with a new token, for this user only.
/// @errors   the file can't be read or created, other users may read it, or it has no token
[[nodiscard]] expected<std::string, SetupError> token_in_file(const std::string& path);

/// Whether the texts are equal, in a time that only depends on their sizes.
[[nodiscard]] bool is_same_token(std::string_view a, std::string_view b) noexcept;

}  // namespace rtpm::console
