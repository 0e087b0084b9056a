#include <string>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "cli/table.hpp"
#include "objects/commands.hpp"
#include "objects/entries.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/directory.hpp"

namespace rtpm::tool {
namespace {

int list_names(Context& context) {
  names::Directory directory(context.node(), context.registry);
  const auto found = awaited(context, "asking for names", [&] { return directory.contents(); });
  tell_notes(directory);
  if (!found) return context.not_reached(found.error());
  warn_if_stale(found->stale_for);
  const auto lost = awaited(context, "asking for lost names",
                            [&] { return lost_names(context, found->entries); });
  print_entries(found->entries, context.json, lost);
  return kDone;
}

int list_objects(Context& context, const std::string& target) {
  const auto url = names::url_of(context.node(), context.registry, target);
  if (!url) return context.not_reached(url.error());
  auto catalog = awaited(context, "binding to the server of " + printable(target), [&] {
    return introspection::IntrospectionClient::bind(context.node(), dynamic::catalog_url(*url));
  });
  if (!catalog) return context.not_reached(catalog.error());
  const auto reply = catalog->list();
  if (!reply) return context.fail(to_string(reply.error()));
  Json json = Json::array();
  std::vector<Row> rows;
  for (const auto* object : *(*reply)->objects()) {
    const auto path = object->path()->string_view();
    const auto interface = object->interface()->string_view();
    rows.push_back({printable(path), printable(interface)});
    json.push_back({{"path", path}, {"interface", interface}});
  }
  if (context.json) {
    print_json(json);
  } else {
    std::fputs(aligned(rows, 2).c_str(), stdout);
  }
  return kDone;
}

}  // namespace

void add_list(CLI::App& program, Context& context) {
  const auto target = std::make_shared<std::string>();
  CLI::App& command = add_command(
      program, context, "list", "List the registry's names, or the objects of a server",
      "  rtpm list\n  rtpm list lab/arm0        the objects of the server that has it\n"
      "A name whose server hangs or is dead stays as LOST, until the server is back or\n"
      "`rtpm unbind` dismisses the name; in JSON it has `is_lost`.\n",
      [target](Context& c) { return target->empty() ? list_names(c) : list_objects(c, *target); });
  add_target(command, *target).required(false);
}

}  // namespace rtpm::tool
