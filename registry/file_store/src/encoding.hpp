#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/names/property.hpp"

namespace rtpm::file_store {

/// The form of properties in a row: fast to read, because a registry reads all of them when it
/// starts. They are separated by control characters, which no text of a property contains.
[[nodiscard]] std::string encode(const std::vector<names::Property>& properties);
/// nullopt if the text has another form.
[[nodiscard]] std::optional<std::vector<names::Property>> decode(std::string_view text);

}  // namespace rtpm::file_store
