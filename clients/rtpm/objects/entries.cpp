#include "objects/entries.hpp"

#include <algorithm>
#include <cstdio>
#include <tuple>

#include "cli/table.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/predicate/value.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/clock.hpp"
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

std::string table_of(const std::vector<names::NameEntry>& entries,
                     const std::vector<names::LapsedName>& lost) {
  std::vector<Row> rows;
  for (const names::NameEntry& entry : entries)
    rows.push_back({printable(entry.name), printable(entry.interface),
                    printable(entry.url) + (entry.is_duplicate ? "  (bound twice)" : "")});
  for (const names::LapsedName& each : lost)
    rows.push_back({printable(each.name), printable(each.interface),
                    lost_text(each) + ", was at " + printable(each.url)});
  return aligned(rows, 3);
}

std::vector<names::LapsedName> lost_names(Context& context,
                                          const std::vector<names::NameEntry>& bound) {
  names::LapsedAnswer answer =
      names::ask_for_lapsed(context.node(), context.registry, rt::now() + kLapsedPatience);
  std::erase_if(answer.names, [&](const names::LapsedName& each) {
    return std::ranges::any_of(bound, [&](const names::NameEntry& entry) {
      return entry.name == each.name && entry.url == each.url;
    });
  });
  const auto key = [](const names::LapsedName& each) { return std::tie(each.name, each.revision); };
  std::ranges::sort(answer.names, {}, key);
  // Registries that share their names all report the same loss.
  const auto same = std::ranges::unique(answer.names, {}, key);
  answer.names.erase(same.begin(), same.end());
  return std::move(answer.names);
}

std::string lost_text(const names::LapsedName& lost) {
  return "LOST for " +
         program::formatted("%.0f s", std::chrono::duration<double>(lost.lapsed_for).count());
}

void warn_if_stale(Duration stale_for) {
  if (stale_for > Duration{0}) rt::print_error("rtpm", names::stale_text(stale_for));
}

void print_entries(const std::vector<names::NameEntry>& entries, bool as_json,
                   const std::vector<names::LapsedName>& lost) {
  if (!as_json) {
    std::fputs(table_of(entries, lost).c_str(), stdout);
    return;
  }
  Json list = Json::array();
  for (const names::NameEntry& entry : entries)
    list.push_back(json_of(entry));
  for (const names::LapsedName& each : lost) {
    list.push_back({{"name", each.name},
                    {"interface", each.interface},
                    {"url", each.url},
                    {"revision", each.revision},
                    {"is_lost", true},
                    {"lost_for_s", std::chrono::duration<double>(each.lapsed_for).count()},
                    {"name_service", each.service_url}});
  }
  print_json(list);
}

}  // namespace rtpm::tool
