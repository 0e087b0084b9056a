#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "rtpm/names/property.hpp"

namespace rtpm::file_store {

using Json = nlohmann::json;

/// [{"name": …, "type": …, "value": …, "unit": …}, …]
[[nodiscard]] Json json_of(const std::vector<names::Property>& properties);
[[nodiscard]] std::optional<std::vector<names::Property>> properties_of(const Json& json);

}  // namespace rtpm::file_store
