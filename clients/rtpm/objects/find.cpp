#include <algorithm>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/pattern.hpp"
#include "cli/progress.hpp"
#include "objects/commands.hpp"
#include "objects/entries.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::tool {
namespace {

struct FindOptions {
  std::string name = "*";
  std::string interface = "*";
  std::string host = "*";
  std::string predicate{};
  std::string preference{};
  std::uint32_t limit = 0;
};

bool fits(const std::string& pattern, const std::string& text) {
  return matches(pattern, text);
}

constexpr const char* kAsking = "asking for names";

/// Whether any of its hosts matches.
bool is_at(const std::string& pattern, const names::NameEntry& entry) {
  const auto parts = wire::parse_url(entry.url);
  return parts && std::ranges::any_of(parts->hosts,
                                      [&](const std::string& host) { return fits(pattern, host); });
}

/// Returns " (did you mean 'rtpm.device.Device'?)" if no interface matches.
std::string similar_interface(const std::vector<names::NameEntry>& entries,
                              const std::string& wanted) {
  std::vector<std::string> interfaces;
  for (const names::NameEntry& entry : entries)
    interfaces.push_back(entry.interface);
  const bool is_there = std::ranges::any_of(
      interfaces, [&](const std::string& interface) { return fits(wanted, interface); });
  return is_there ? std::string{} : program::suggestion(wanted, interfaces);
}

bool has_wildcard(const std::string& pattern) {
  return pattern.find_first_of("*?[\\") != std::string::npos;
}

/// Queries the registry, which evaluates predicate and preference; this program matches the
/// patterns.
expected<std::vector<names::NameEntry>, int> ask(Context& context, const FindOptions& wanted) {
  names::Directory directory(context.node(), context.registry);
  if (wanted.predicate.empty() && wanted.preference.empty()) {
    auto all = awaited(context, kAsking, [&] { return directory.contents(); });
    if (!all) return unexpected{context.not_reached(all.error())};
    warn_if_stale(all->stale_for);
    tell_notes(directory);
    return std::move(all->entries);
  }
  const std::string interface = has_wildcard(wanted.interface) ? "" : wanted.interface;
  auto found = awaited(context, kAsking, [&] {
    return directory.find({interface, wanted.predicate, wanted.preference});
  });
  if (!found) {
    const names::DirectoryError& error = found.error();
    if (!error.text_error) return unexpected{context.not_reached(error)};
    const bool is_predicate = error.outcome == names::Outcome::kBadPredicate;
    return unexpected{context.fail_at(is_predicate ? "predicate" : "preference",
                                      is_predicate ? wanted.predicate : wanted.preference,
                                      *error.text_error)};
  }
  warn_if_stale(found->stale_for);
  tell_notes(directory);
  if (!found->note.empty()) rt::print_error("rtpm", found->note);
  if (found->entries.size() < found->accepted_count) {
    rt::print_error("rtpm", std::to_string(found->accepted_count - found->entries.size()) +
                                " more names fit than a reply takes");
  }
  return std::move(found->entries);
}

int find(Context& context, const FindOptions& wanted) {
  const auto entries = ask(context, wanted);
  if (!entries) return entries.error();
  std::vector<names::NameEntry> found;
  std::ranges::copy_if(*entries, std::back_inserter(found), [&](const names::NameEntry& entry) {
    return fits(wanted.name, entry.name) && fits(wanted.interface, entry.interface) &&
           is_at(wanted.host, entry);
  });
  if (wanted.limit != 0 && found.size() > wanted.limit) found.resize(wanted.limit);
  print_entries(found, context.json);
  if (!found.empty()) return kDone;
  // The predicate has excluded names, so fetch all of them.
  const auto all = names::Directory(context.node(), context.registry).contents();
  if (!all) return context.not_reached(all.error());
  const std::size_t count = all->entries.size();
  if (count == 0) return context.fail("no name is bound");
  return context.fail("none of the " + std::to_string(count) + " names fits" +
                      similar_interface(all->entries, wanted.interface));
}

}  // namespace

void add_find(CLI::App& program, Context& context) {
  const auto wanted = std::make_shared<FindOptions>();
  CLI::App& command =
      add_command(program, context, "find", "Find names by form, interface, host and properties",
                  "  rtpm find 'lab/*'\n  rtpm find --interface rtpm.device.Device\n"
                  "  rtpm find --where \"class == 'haptic' and force_newton_max >= 3\"\n"
                  "In patterns * stands for any text, also with '/', ? for a character. The exit\n"
                  "code is 1 if nothing fits.\n",
                  [wanted](Context& c) { return find(c, *wanted); });
  command.add_option("PATTERN", wanted->name, "Of the name")->capture_default_str()->type_name("");
  command.add_option("--interface", wanted->interface, "Pattern of the interface")
      ->capture_default_str();
  command.add_option("--host", wanted->host, "Pattern of the host in the URL")
      ->capture_default_str();
  command.add_option("--where", wanted->predicate,
                     "Of the properties: \"'x' in axes and rate_hz > 500\"");
  command.add_option("--prefer", wanted->preference,
                     "Which come first: 'min E', 'max E', 'with E', random, first");
  command.add_option("--limit", wanted->limit, "How many at most; 0: all")->capture_default_str();
}

}  // namespace rtpm::tool
