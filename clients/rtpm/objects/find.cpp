#include <fnmatch.h>

#include <algorithm>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "objects/commands.hpp"
#include "objects/entries.hpp"
#include "rtpm/options/suggestion.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::tool {
namespace {

struct FindOptions {
  std::string name = "*";
  std::string interface = "*";
  std::string host = "*";
};

bool fits(const std::string& pattern, const std::string& text) {
  return ::fnmatch(pattern.c_str(), text.c_str(), 0) == 0;
}

std::string host_of(const names::NameEntry& entry) {
  const auto parts = wire::parse_url(entry.url);
  return parts ? parts->host : std::string{};
}

/// " (did you mean 'rtpm.device.Device'?)", where no interface fits.
std::string similar_interface(const std::vector<names::NameEntry>& entries,
                              const std::string& wanted) {
  std::vector<std::string> interfaces;
  for (const names::NameEntry& entry : entries)
    interfaces.push_back(entry.interface);
  const bool is_there = std::ranges::any_of(
      interfaces, [&](const std::string& interface) { return fits(wanted, interface); });
  return is_there ? std::string{} : options::suggestion(wanted, interfaces);
}

int find(Context& context, const FindOptions& wanted) {
  const auto entries = names::Directory(context.node(), context.registry).list();
  if (!entries) return context.not_reached(entries.error());
  std::vector<names::NameEntry> found;
  std::ranges::copy_if(*entries, std::back_inserter(found), [&](const names::NameEntry& entry) {
    return fits(wanted.name, entry.name) && fits(wanted.interface, entry.interface) &&
           fits(wanted.host, host_of(entry));
  });
  print_entries(found, context.json);
  if (!found.empty()) return kDone;
  return context.fail("none of the registry's " + std::to_string(entries->size()) + " names fits" +
                      similar_interface(*entries, wanted.interface));
}

}  // namespace

void add_find(CLI::App& program, Context& context) {
  const auto wanted = std::make_shared<FindOptions>();
  CLI::App& command =
      add_command(program, context, "find", "Find names by their form, interface and host",
                  "  rtpm find 'lab/*'\n  rtpm find --interface rtpm.device.Device\n"
                  "In patterns * stands for any text, also with '/', ? for a character. The exit\n"
                  "code is 1 if nothing fits.\n",
                  [wanted](Context& c) { return find(c, *wanted); });
  command.add_option("PATTERN", wanted->name, "Of the name")->capture_default_str()->type_name("");
  command.add_option("--interface", wanted->interface, "Pattern of the interface")
      ->capture_default_str();
  command.add_option("--host", wanted->host, "Pattern of the host in the URL")
      ->capture_default_str();
}

}  // namespace rtpm::tool
