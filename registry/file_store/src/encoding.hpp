#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/names/property.hpp"

namespace rtpm::file_store {

/// Encodes properties for a row. Fast to read, because a registry reads all of them when it starts.
/// Control characters separate them, which no text of a property contains.
[[nodiscard]] std::string encode(const std::vector<names::Property>& properties);
/// Decodes properties; nullopt if the text has another form.
[[nodiscard]] std::optional<std::vector<names::Property>> decode(std::string_view text);

}  // namespace rtpm::file_store
