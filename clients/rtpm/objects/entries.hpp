#pragma once

#include <string>
#include <vector>

#include "cli/output.hpp"
#include "rtpm/names/directory.hpp"

namespace rtpm::tool {

/// A bound name for machines: name, interface, URL, seconds of lease left, revision.
[[nodiscard]] Json json_of(const names::NameEntry& entry);

/// Bound names for people, a line each; without any, nothing.
[[nodiscard]] std::string table_of(const std::vector<names::NameEntry>& entries);

/// Says on standard error that the registry is out of date, if it is.
void warn_if_stale(Duration stale_for);

/// Prints the names as --json says.
void print_entries(const std::vector<names::NameEntry>& entries, bool as_json);

}  // namespace rtpm::tool
