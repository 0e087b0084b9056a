#include "host/peers.hpp"

#include <map>
#include <set>
#include <string>

#include "rtpm/base/printable.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/reachable.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::tool {
namespace {

using rt::Finding;
using rt::Severity;

struct Interface {
  std::map<std::uint64_t, std::string> names{};  ///< Keyed by fingerprint, with one object each.
};
struct Peers {
  std::map<std::string, Interface> interfaces{};
  std::map<std::string, std::string> compilers{};  ///< Keyed by version, with one object each.
  std::vector<Finding> findings{};
};

void ask(Context& context, const names::NameEntry& entry, Peers& peers) {
  const auto url = names::reachable_url(entry);
  if (!url) {
    peers.findings.push_back({"server", Severity::kProblem, url.error().reason(),
                              "no program of this host can call it", url.error().remedy});
    return;
  }
  const auto parts = wire::parse_url(*url);
  auto catalog =
      introspection::IntrospectionClient::bind(context.node(), dynamic::catalog_url(*url));
  if (!parts || !catalog) {
    peers.findings.push_back(
        {"server", Severity::kProblem,
         "'" + printable(entry.name) + "' is bound, but no server answers at " + printable(*url),
         "each call of it ends with its deadline, until the name's lease ends",
         "see whether its program runs, and whether this host reaches it"});
    return;
  }
  introspection::DescribeRequestT request;
  request.path = parts->path;
  const auto description = catalog->describe(request);
  if (!description) return;  // The server does not describe this object.
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

std::vector<Finding> survey_peers(Context& context) {
  const auto entries = names::Directory(context.node(), context.registry).list();
  if (!entries) {
    return {{"registry", Severity::kNote, printable(entries.error().reason(), kShownWhole),
             "programs find no name; URLs still lead to servers", entries.error().remedy}};
  }
  Peers peers;
  for (const names::NameEntry& entry : *entries)
    ask(context, entry, peers);
  for (const auto& [name, interface] : peers.interfaces) {
    if (interface.names.size() < 2) continue;
    peers.findings.push_back(
        {"interface", Severity::kWarning,
         "servers have different schemas of " + printable(name) + ": " + names_in(interface.names),
         "a client of one is refused by the other where the schemas do not fit together",
         "build them from one schema (rtpm info NAME --schema shows each)"});
  }
  if (peers.compilers.size() > 1) {
    peers.findings.push_back({"versions", Severity::kWarning,
                              "servers are of different releases: " + names_in(peers.compilers),
                              "before 1.0.0, releases may not understand each other",
                              "update the older ones"});
  }
  if (peers.findings.empty()) {
    peers.findings.push_back({"servers", Severity::kGood,
                              "all " + std::to_string(entries->size()) +
                                  " names of the registry answer, with schemas in common"});
  }
  return std::move(peers.findings);
}

}  // namespace rtpm::tool
