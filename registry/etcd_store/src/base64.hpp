#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace rtpm::etcd_store {

/// The encoding of bytes in the JSON of etcd's gateway: RFC 4648, padded.
[[nodiscard]] std::string to_base64(std::string_view bytes);
/// @return nullopt if `text` is not Base64
[[nodiscard]] std::optional<std::string> from_base64(std::string_view text);

}  // namespace rtpm::etcd_store
