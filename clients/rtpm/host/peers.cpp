#include "host/peers.hpp"

#include <map>
#include <set>
#include <string>

#include "rtpm/base/printable.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::tool {
namespace {

using rt::Grant;
using rt::SetupNote;

struct Interface {
  std::map<std::uint64_t, std::string> names{};  ///< By fingerprint: one object of each.
};
struct Peers {
  std::map<std::string, Interface> interfaces{};
  std::map<std::string, std::string> compilers{};  ///< By version: one object of each.
  std::vector<SetupNote> notes{};
};

void ask(Context& context, const names::NameEntry& entry, Peers& peers) {
  const auto parts = wire::parse_url(entry.url);
  auto catalog =
      introspection::IntrospectionClient::bind(context.node(), dynamic::catalog_url(entry.url));
  if (!parts || !catalog) {
    peers.notes.push_back({"'" + printable(entry.name) + "'", Grant::kRefused,
                           "its server does not answer at " + printable(entry.url),
                           "see whether it runs, and whether this host reaches it."});
    return;
  }
  introspection::DescribeRequestT request;
  request.path = parts->path;
  const auto description = catalog->describe(request);
  if (!description) return;  // An object that its server does not describe.
  peers.interfaces[entry.interface].names.emplace((*description)->fingerprint(), entry.name);
  peers.compilers.emplace((*description)->compiler_version()->str(), entry.name);
}

/// "lab/arm0, lab/arm1".
template <class Map>
std::string names_in(const Map& map) {
  std::string text;
  for (const auto& [key, name] : map)
    text += (text.empty() ? "" : ", ") + printable(name);
  return text;
}

}  // namespace

std::vector<SetupNote> survey_peers(Context& context) {
  const auto entries = names::Directory(context.node(), context.registry).list();
  if (!entries) {
    return {{"registry", Grant::kNotAsked, printable(entries.error().reason(), kShownWhole),
             entries.error().remedy + "."}};
  }
  Peers peers;
  for (const names::NameEntry& entry : *entries)
    ask(context, entry, peers);
  for (const auto& [name, interface] : peers.interfaces) {
    if (interface.names.size() < 2) continue;
    peers.notes.push_back({"interface " + printable(name), Grant::kPartly,
                           "servers have different schemas of it: " + names_in(interface.names),
                           "build them from one schema (rtpm info NAME shows each)."});
  }
  if (peers.compilers.size() > 1) {
    peers.notes.push_back({"versions", Grant::kPartly,
                           "servers are of different releases: " + names_in(peers.compilers),
                           "update the older ones."});
  }
  if (peers.notes.empty()) {
    peers.notes.push_back({"servers", Grant::kGranted,
                           "all " + std::to_string(entries->size()) +
                               " names of the registry answer, with schemas in common",
                           ""});
  }
  return std::move(peers.notes);
}

}  // namespace rtpm::tool
