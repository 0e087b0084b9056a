#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/recording/mcap.hpp"

namespace rtpm::recording {

/// The compression as a chunk spells it: "", "lz4" or "zstd".
[[nodiscard]] std::string_view to_string(Compression compression) noexcept;

/// Replaces `compressed` by the compressed `bytes`. kLz4 means LZ4's frame format, as MCAP demands.
void compress(Compression compression, ConstBytes bytes, std::vector<std::byte>& compressed);

/// Decompresses; nullopt for an unknown compression, damaged bytes, or a different size.
/// @param size  as stated by the chunk, and already limited by the caller
[[nodiscard]] std::optional<std::vector<std::byte>> decompress(std::string_view compression,
                                                               ConstBytes compressed,
                                                               std::size_t size);

}  // namespace rtpm::recording
