#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "objects/commands.hpp"
#include "objects/entries.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/lapsed.hpp"
#include "rtpm/names/reachable.hpp"
#include "rtpm/predicate/value.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"

// Permanent names, which users bind, unbind and look up.
namespace rtpm::tool {
namespace {

struct BindOptions {
  std::string name{};
  std::string url{};
  std::string interface {};
  std::vector<std::string> properties{};
  bool replaces = false;
};

/// NAME=VALUE or NAME:UNIT=VALUE.
expected<names::Property, SetupError> property_of(const std::string& text) {
  const std::size_t equals = text.find('=');
  auto value =
      equals == std::string::npos ? std::nullopt : predicate::parse_value(text.substr(equals + 1));
  if (!value) {
    return setup_error("'" + text + "' is no property", "",
                       "write NAME=VALUE or NAME:UNIT=VALUE, such as force:newton=3.5");
  }
  const std::string name = text.substr(0, equals);
  const std::size_t colon = name.find(':');
  return names::Property{name.substr(0, colon), std::move(*value),
                         colon == std::string::npos ? "" : name.substr(colon + 1)};
}

/// The revision of the current binding, for a change; 0 if the name is not bound.
std::uint64_t revision_of(names::Directory& directory, const std::string& name) {
  const auto entry = directory.resolve(name);
  return entry ? entry->revision : 0;
}

int bind(Context& context, const BindOptions& wanted) {
  std::vector<names::Property> properties;
  for (const std::string& text : wanted.properties) {
    auto property = property_of(text);
    if (!property) return context.fail(property.error(), kMisused);
    properties.push_back(std::move(*property));
  }
  names::Directory directory(context.node(), context.registry);
  // A user does not restart like a server, so each bind has a new owner.
  names::Claim claim{wanted.name, wanted.url, wanted.interface, {rt::random_u64(), 1}};
  claim.properties = properties;
  claim.is_permanent = true;
  if (wanted.replaces) claim.holder_revision = revision_of(directory, wanted.name);
  const auto bound = wanted.replaces ? directory.rebind(claim) : directory.bind(claim);
  if (!bound) {
    const names::DirectoryError& error = bound.error();
    const bool is_held = error.outcome == names::Outcome::kAlreadyBound;
    return error.outcome ? context.fail(error.text() + (is_held ? "; --replace takes it" : ""))
                         : context.not_reached(error);
  }
  if (context.json) {
    print_json({{"name", wanted.name}, {"revision", bound->revision}});
  } else {
    print_line(printable(wanted.name) + " is bound to " + printable(wanted.url));
  }
  return kDone;
}

/// Removes the record of a name whose server is lost; nullopt if it is not lost.
std::optional<int> dismiss(Context& context, const std::string& name) {
  std::optional<std::uint64_t> revision;
  const auto lost =
      names::ask_for_lapsed(context.node(), context.registry, rt::now() + kLapsedPatience).names;
  for (const names::LapsedName& each : lost) {
    if (each.name != name) continue;
    if (const auto dismissed = names::dismiss(context.node(), each); !dismissed) {
      return context.not_reached(dismissed.error());
    }
    revision = each.revision;
  }
  if (!revision) return std::nullopt;
  if (context.json) {
    print_json({{"name", name}, {"revision", *revision}, {"was_lost", true}});
  } else {
    print_line(printable(name) + " was lost, and is dismissed");
  }
  return kDone;
}

int unbind(Context& context, const std::string& name) {
  names::Directory directory(context.node(), context.registry);
  const auto entry = directory.resolve(name);
  if (!entry) {
    if (const auto code = dismiss(context, name)) return *code;
    return context.not_reached(entry.error());
  }
  const auto unbound = directory.unbind(name, {rt::random_u64(), 1}, entry->revision);
  if (!unbound) return context.not_reached(unbound.error());
  if (context.json) {
    print_json({{"name", name}, {"revision", entry->revision}});
  } else {
    print_line(printable(name) + " is unbound");
  }
  return kDone;
}

int resolve(Context& context, const std::string& name) {
  names::Directory directory(context.node(), context.registry);
  const auto entry = directory.entry_of(name);
  tell_notes(directory);
  if (!entry) return context.not_reached(entry.error());
  warn_if_stale(entry->stale_for);
  const auto reachable = names::reachable_url(*entry);
  if (!reachable) return context.not_reached(reachable.error());
  const std::string url = *reachable + name.substr(entry->name.size());
  if (!context.json) {
    print_line(printable(url));
    return kDone;
  }
  const auto described = directory.describe(entry->name);
  if (!described) return context.not_reached(described.error());
  Json json = json_of(*described);
  json["url"] = url;
  print_json(json);
  return kDone;
}

void add_name(CLI::App& command, std::string& name) {
  command.add_option("NAME", name, "Such as lab/arm0")->required()->type_name("");
}

}  // namespace

void add_bind(CLI::App& program, Context& context) {
  const auto wanted = std::make_shared<BindOptions>();
  CLI::App& command = add_command(
      program, context, "bind", "Bind a name at the registry until it is unbound",
      "  rtpm bind lab/camera rtpm://10.0.0.7:7500/camera --interface lab.Camera\n"
      "  rtpm bind lab/camera rtpm://10.0.0.8:7500/camera --interface lab.Camera --replace\n"
      "  rtpm bind lab/old rtpm://10.0.0.9:1/x --interface lab.X --property force:newton=3.5\n"
      "Servers bind their names themselves, with a lease; this is for those that do not. The name\n"
      "outlasts the registry where that runs with --store FILE.\n",
      [wanted](Context& c) { return bind(c, *wanted); });
  add_name(command, wanted->name);
  command.add_option("URL", wanted->url, "rtpm://host:port/path")->required()->type_name("");
  command.add_option("--interface", wanted->interface, "Such as lab.Camera")->required();
  command.add_option("--property", wanted->properties, "NAME=VALUE or NAME:UNIT=VALUE, repeatedly");
  command.add_flag("--replace", wanted->replaces, "Take the name from its present holder");
}

void add_unbind(CLI::App& program, Context& context) {
  const auto name = std::make_shared<std::string>();
  CLI::App& command =
      add_command(program, context, "unbind", "Remove a name from the registry",
                  "  rtpm unbind lab/camera\n"
                  "A server that runs binds its name again, within a third of its lease. A name\n"
                  "that is LOST in `rtpm list` is dismissed.\n",
                  [name](Context& c) { return unbind(c, *name); });
  add_name(command, *name);
}

void add_resolve(CLI::App& program, Context& context) {
  const auto name = std::make_shared<std::string>();
  CLI::App& command = add_command(
      program, context, "resolve", "Print the URL that a name leads to",
      "  rtpm resolve lab/arm0\n"
      "Below a bound name it is the object below its URL. Of a server with several addresses it\n"
      "has those that this host can reach, in the order in which programs here try them. With\n"
      "--json come its properties, and all addresses.\n",
      [name](Context& c) { return resolve(c, *name); });
  add_name(command, *name);
}

}  // namespace rtpm::tool
