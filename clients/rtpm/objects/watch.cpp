#include <string>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "objects/commands.hpp"
#include "objects/entries.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/names/watch.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {
namespace {

struct WatchOptions {
  std::string directory{};
  std::string interface {};
  std::string predicate{};
  std::optional<Duration> time{};
};

const char* word_of(names::NameChange::Kind kind) {
  switch (kind) {
    case names::NameChange::Kind::kBound:
      return "bound";
    case names::NameChange::Kind::kChanged:
      return "moved";
    case names::NameChange::Kind::kGone:
      break;
  }
  return "gone";
}

void tell(const Context& context, const names::NameChange& change) {
  const names::NameEntry& entry = change.entry;
  if (context.json) {
    Json json{{"change", word_of(change.kind)}};
    json.update(json_of(entry));
    print_json(json);
    return;
  }
  print_line(std::string(word_of(change.kind)) + "  " + printable(entry.name) + "  " +
             printable(entry.interface) + "  " + printable(entry.url));
}

// Reports when the registry is out of date, and when it is current again.
void tell(const Context& context, Duration stale_for) {
  warn_if_stale(stale_for);
  if (context.json) {
    const double seconds = std::chrono::duration<double>(stale_for).count();
    print_json({{"change", "stale"}, {"stale_s", seconds}});
  } else if (stale_for == Duration{0}) {
    rt::print_error("rtpm", "the registry is up to date again");
  }
}

int watch(Context& context, const WatchOptions& wanted) {
  const program::StopSignal& stop = context.stop();
  const auto watch = names::NameWatch::start(
      context.node(), context.registry,
      {.directory = wanted.directory, .interface = wanted.interface, .predicate = wanted.predicate},
      {.on_change = [&](const names::NameChange& change) { tell(context, change); },
       .on_stale = [&](Duration stale_for) { tell(context, stale_for); },
       .on_notice = [](std::string_view sentence) { rt::print_error("rtpm", sentence); }});
  if (!watch) {
    const names::DirectoryError& error = watch.error();
    return error.text_error ? context.fail_at("predicate", wanted.predicate, *error.text_error)
                            : context.not_reached(error);
  }
  if (wanted.time) {
    static_cast<void>(stop.wait_for(*wanted.time));
  } else {
    stop.wait();
  }
  return kDone;
}

}  // namespace

void add_watch(CLI::App& program, Context& context) {
  const auto wanted = std::make_shared<WatchOptions>();
  CLI::App& command = add_command(
      program, context, "watch", "Print the registry's names as they come, change and go",
      "  rtpm watch lab\n  rtpm watch --where \"class == 'haptic' and rate_hz > 500\"\n"
      "First come the names that are bound now. A name that fits no more is gone; one that leads\n"
      "elsewhere, or has another holder or other properties, has moved. Ends with Ctrl-C; a\n"
      "registry that went away is told once, and awaited.\n",
      [wanted](Context& c) { return watch(c, *wanted); });
  command.add_option("DIRECTORY", wanted->directory, "Only names in it; without: all")
      ->type_name("");
  command.add_option("--interface", wanted->interface, "Only names of this interface");
  command.add_option("--where", wanted->predicate, "Only names whose properties are so");
  add_duration(command, "--for", wanted->time, "How long; without: until Ctrl-C",
               {Duration{0}, std::chrono::hours{24}});
}

}  // namespace rtpm::tool
