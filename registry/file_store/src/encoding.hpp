#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/names/property.hpp"

namespace rtpm::file_store {

/// Properties as a row has them: quick to read, as a registry reads all of them when it starts.
/// Control characters separate them, which no text of a property has.
[[nodiscard]] std::string encode(const std::vector<names::Property>& properties);
/// nullopt: they were not written so.
[[nodiscard]] std::optional<std::vector<names::Property>> decode(std::string_view text);

}  // namespace rtpm::file_store
