#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace rtpm::etcd_store {

/// Bytes as etcd's gateway has them in JSON: RFC 4648, padded.
[[nodiscard]] std::string to_base64(std::string_view bytes);
/// @return nullopt: `text` is no Base64
[[nodiscard]] std::optional<std::string> from_base64(std::string_view text);

}  // namespace rtpm::etcd_store
