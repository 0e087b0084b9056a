#include <map>
#include <string>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "objects/commands.hpp"
#include "objects/entries.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::tool {
namespace {

/// How soon a change is seen.
constexpr Duration kPeriod = std::chrono::milliseconds{250};

struct WatchOptions {
  std::string directory{};
  std::optional<Duration> time{};
};

using Names = std::map<std::string, names::NameEntry>;

void tell(const Context& context, const char* change, const names::NameEntry& entry) {
  if (context.json) {
    Json json{{"change", change}};
    json.update(json_of(entry));
    print_json(json);
    return;
  }
  print_line(std::string(change) + "  " + printable(entry.name) + "  " +
             printable(entry.interface) + "  " + printable(entry.url));
}

void tell_changes(const Context& context, const Names& before, const Names& now) {
  for (const auto& [name, entry] : before) {
    if (!now.contains(name)) tell(context, "gone", entry);
  }
  for (const auto& [name, entry] : now) {
    const auto former = before.find(name);
    if (former == before.end()) {
      tell(context, "bound", entry);
    } else if (former->second.url != entry.url || former->second.revision != entry.revision) {
      tell(context, "moved", entry);
    }
  }
}

int watch(Context& context, const WatchOptions& wanted) {
  const options::StopSignal& stop = context.stop();
  names::Directory directory(context.node(), context.registry);
  const MonotonicTime end = wanted.time ? rt::now() + *wanted.time : kNever;
  Names before;
  bool is_lost = false;
  for (bool is_first = true; is_first || (rt::now() < end && !stop.wait_for(kPeriod));
       is_first = false) {
    const auto entries = directory.list(wanted.directory);
    if (!entries && is_first) return context.not_reached(entries.error());
    if (!entries) {
      if (!is_lost) context.not_reached(entries.error());
      is_lost = true;
      continue;
    }
    is_lost = false;
    Names now;
    for (const names::NameEntry& entry : *entries)
      now.emplace(entry.name, entry);
    tell_changes(context, before, now);
    before = std::move(now);
  }
  return kDone;
}

}  // namespace

void add_watch(CLI::App& program, Context& context) {
  const auto wanted = std::make_shared<WatchOptions>();
  CLI::App& command = add_command(
      program, context, "watch", "Print the registry's names as they come, move and go",
      "  rtpm watch lab\n"
      "First come the names that are bound now. Ends with Ctrl-C; a registry that went away is\n"
      "told once, and awaited.\n",
      [wanted](Context& c) { return watch(c, *wanted); });
  command.add_option("DIRECTORY", wanted->directory, "Only names in it; without: all")
      ->type_name("");
  add_duration(command, "--for", wanted->time, "How long; without: until Ctrl-C",
               {Duration{0}, std::chrono::hours{24}});
}

}  // namespace rtpm::tool
