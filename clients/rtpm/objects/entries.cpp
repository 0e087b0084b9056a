#include "objects/entries.hpp"

#include <cstdio>

#include "cli/table.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/predicate/value.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::tool {

namespace {

Json value_json(const names::PropertyValue& value) {
  return std::visit(
      [](const auto& held) -> Json {
        if constexpr (std::is_same_v<std::decay_t<decltype(held)>, names::PropertyList>) {
          Json list = Json::array();
          for (const auto& item : held.items)
            list.push_back(std::visit([](const auto& each) { return Json(each); }, item));
          return list;
        } else {
          return held;
        }
      },
      value);
}

}  // namespace

Json json_of(const names::NameEntry& entry) {
  Json json{{"name", entry.name},
            {"interface", entry.interface},
            {"url", entry.url},
            {"revision", entry.revision}};
  if (const auto url = wire::parse_url(entry.url)) {
    json["hosts"] = url->hosts;
    json["port"] = url->port;
  }
  if (!entry.bound_from.empty()) json["bound_from"] = entry.bound_from;
  json["is_of_other_host"] = entry.is_of_other_host;
  if (entry.is_permanent) {
    json["is_permanent"] = true;
  } else {
    json["lease_left_s"] = std::chrono::duration<double>(entry.lease_left).count();
  }
  if (entry.stale_for > Duration{0}) {
    json["stale_s"] = std::chrono::duration<double>(entry.stale_for).count();
  }
  if (!entry.service_url.empty()) json["name_service"] = entry.service_url;
  if (entry.is_duplicate) json["is_duplicate"] = true;
  json.update(properties_json(entry.properties));
  return json;
}

Json properties_json(const std::vector<names::Property>& properties) {
  Json json = Json::object();
  for (const names::Property& property : properties) {
    json["properties"][property.name] = value_json(property.value);
    if (!property.unit.empty()) json["units"][property.name] = property.unit;
  }
  return json;
}

std::vector<std::string> lines_of(const std::vector<names::Property>& properties) {
  std::vector<std::string> lines;
  for (const names::Property& property : properties) {
    lines.push_back(printable(property.name) + " = " +
                    printable(predicate::to_text(property.value), kShownWhole) +
                    (property.unit.empty() ? "" : " " + printable(property.unit)));
  }
  return lines;
}

void tell_notes(const names::Directory& directory) {
  for (const std::string& note : directory.notes())
    rt::print_error("rtpm", note);
}

std::string table_of(const std::vector<names::NameEntry>& entries) {
  std::vector<Row> rows;
  for (const names::NameEntry& entry : entries)
    rows.push_back({printable(entry.name), printable(entry.interface),
                    printable(entry.url) + (entry.is_duplicate ? "  (bound twice)" : "")});
  return aligned(rows, 3);
}

void warn_if_stale(Duration stale_for) {
  if (stale_for > Duration{0}) rt::print_error("rtpm", names::stale_text(stale_for));
}

void print_entries(const std::vector<names::NameEntry>& entries, bool as_json) {
  if (!as_json) {
    std::fputs(table_of(entries).c_str(), stdout);
    return;
  }
  Json list = Json::array();
  for (const names::NameEntry& entry : entries)
    list.push_back(json_of(entry));
  print_json(list);
}

}  // namespace rtpm::tool
