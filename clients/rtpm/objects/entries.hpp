#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "cli/context.hpp"
#include "cli/output.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/lapsed.hpp"

namespace rtpm::tool {

/// A bound name as JSON: name, interface, URL, remaining seconds of the lease, revision.
[[nodiscard]] Json json_of(const names::NameEntry& entry);

/// Only the properties, as {"properties": {…}, "units": {…}}; empty if there are none.
[[nodiscard]] Json properties_json(const std::vector<names::Property>& properties);
/// The properties as text, one line each: "rate_hz = 1000 hertz".
[[nodiscard]] std::vector<std::string> lines_of(const std::vector<names::Property>& properties);

/// Reports on standard error what the directory's last operation left out.
void tell_notes(const names::Directory& directory);

/// Bound names as a table, one line each; empty if there are none.
[[nodiscard]] std::string table_of(const std::vector<names::NameEntry>& entries,
                                   const std::vector<names::LapsedName>& lost = {});

/// Warns on standard error if the registry is out of date.
void warn_if_stale(Duration stale_for);

/// Prints the names, in the format that --json selects, lost ones last.
void print_entries(const std::vector<names::NameEntry>& entries, bool as_json,
                   const std::vector<names::LapsedName>& lost = {});

/// How long registries may take to list lost names.
inline constexpr Duration kLapsedPatience = std::chrono::seconds{1};
/// Names whose servers are lost, except those that another name service binds to the same URL.
[[nodiscard]] std::vector<names::LapsedName> lost_names(Context& context,
                                                        const std::vector<names::NameEntry>& bound);
/// "LOST for 12 s".
[[nodiscard]] std::string lost_text(const names::LapsedName& lost);

}  // namespace rtpm::tool
