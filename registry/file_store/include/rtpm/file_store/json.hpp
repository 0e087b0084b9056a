#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/names/property.hpp"
#include "rtpm/names/storage.hpp"

/// Permanent names as JSON, for moving them between registries:
///
///     {"version": 1, "names": [{"name": "lab/arm0", "url": "rtpm://…", "interface": "lab.Arm",
///       "properties": [{"name": "force", "type": "real", "value": 3.5, "unit": "newton"}]}]}
namespace rtpm::file_store {

/// Formats the permanent names in `names` as JSON.
[[nodiscard]] std::string to_json(const std::vector<names::StoredName>& names);

/// Parses names to be bound: without revisions, with the owner `owner`.
/// @errors   the text is not JSON of this form; the error gives the position
[[nodiscard]] expected<std::vector<names::StoredName>, SetupError> parse_json(std::string_view text,
                                                                              names::Owner owner);

/// Formats properties like the list in that JSON.
[[nodiscard]] std::string properties_to_json(const std::vector<names::Property>& properties);
/// Parses such a list; nullopt if the text is not a list of properties.
[[nodiscard]] std::optional<std::vector<names::Property>> properties_from_json(
    std::string_view text);

}  // namespace rtpm::file_store
