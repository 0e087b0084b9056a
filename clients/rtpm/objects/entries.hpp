#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "cli/context.hpp"
#include "cli/output.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/lapsed.hpp"

namespace rtpm::tool {

/// A bound name for machines: name, interface, URL, seconds of lease left, revision.
[[nodiscard]] Json json_of(const names::NameEntry& entry);

/// The properties alone, as they stand there: {"properties": {…}, "units": {…}}, if there are any.
[[nodiscard]] Json properties_json(const std::vector<names::Property>& properties);
/// The properties for people, a line each: "rate_hz = 1000 hertz".
[[nodiscard]] std::vector<std::string> lines_of(const std::vector<names::Property>& properties);

/// What the directory's last operation left out, on standard error.
void tell_notes(const names::Directory& directory);

/// Bound names for people, a line each; without any, nothing.
[[nodiscard]] std::string table_of(const std::vector<names::NameEntry>& entries,
                                   const std::vector<names::LapsedName>& lost = {});

/// Says on standard error that the registry is out of date, if it is.
void warn_if_stale(Duration stale_for);

/// Prints the names as --json says, those that are lost after the others.
void print_entries(const std::vector<names::NameEntry>& entries, bool as_json,
                   const std::vector<names::LapsedName>& lost = {});

/// How long registries may take to list lost names.
inline constexpr Duration kLapsedPatience = std::chrono::seconds{1};
/// Names whose servers are lost, without those that another name service has for the same URL.
[[nodiscard]] std::vector<names::LapsedName> lost_names(Context& context,
                                                        const std::vector<names::NameEntry>& bound);
/// "LOST for 12 s".
[[nodiscard]] std::string lost_text(const names::LapsedName& lost);

}  // namespace rtpm::tool
