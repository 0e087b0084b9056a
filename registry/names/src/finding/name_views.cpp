#include "finding/name_views.hpp"

#include <utility>

#include "rtpm/base/printable.hpp"

namespace rtpm::names {
namespace {

bool is_same(const NameEntry& one, const NameEntry& other) {
  // Revisions of different services are not comparable.
  const bool is_same_holder =
      one.service_url != other.service_url || one.revision == other.revision;
  return is_same_holder && one.url == other.url && one.interface == other.interface &&
         one.properties == other.properties;
}

/// A second URL that the entries lead to; empty if all lead to the same one.
std::string second_url(const std::map<std::string, NameEntry>& entries) {
  for (const auto& [service, entry] : entries) {
    if (entry.url != entries.begin()->second.url) return entry.url;
  }
  return {};
}

}  // namespace

NameViews::Told NameViews::take(const std::string& service_url, NameChange change) {
  const std::string name = change.entry.name;
  Entries& entries = names_[name];
  const std::optional<NameEntry> before =
      entries.empty() ? std::nullopt : std::optional(entries.begin()->second);
  const bool was_duplicate = !second_url(entries).empty();
  change.entry.service_url = service_url;
  if (change.kind == NameChange::Kind::kGone) {
    entries.erase(service_url);
  } else {
    entries.insert_or_assign(service_url, change.entry);
  }
  Told told;
  if (entries.empty()) {
    if (before) told.change = {NameChange::Kind::kGone, *before};
    names_.erase(name);
    return told;
  }
  NameEntry now = entries.begin()->second;
  const std::string second = second_url(entries);
  now.is_duplicate = !second.empty();
  if (now.is_duplicate && !was_duplicate) {
    told.duplicate = "the name '" + printable(name) + "' is bound twice: to " + printable(now.url) +
                     " and to " + printable(second);
  }
  if (!before) {
    told.change = {NameChange::Kind::kBound, now};
  } else if (!is_same(*before, now) || now.is_duplicate != was_duplicate) {
    told.change = {NameChange::Kind::kChanged, now};
  }
  return told;
}

std::vector<NameEntry> NameViews::names_of(const std::string& service_url) const {
  std::vector<NameEntry> found;
  for (const auto& [name, entries] : names_) {
    const auto entry = entries.find(service_url);
    if (entry != entries.end()) found.push_back(entry->second);
  }
  return found;
}

}  // namespace rtpm::names
