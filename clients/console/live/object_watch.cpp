#include "live/object_watch.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/reachable.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::console {
namespace {

constexpr Duration kRegistryDeadline = std::chrono::milliseconds{500};
constexpr Duration kCatalogDeadline = std::chrono::milliseconds{300};
constexpr Duration kCatalogInterval = std::chrono::seconds{5};
constexpr Duration kLapsedInterval = std::chrono::seconds{5};
constexpr std::size_t kObjectCountMax = 1024;

}  // namespace

ObjectWatch::ObjectWatch(rpc::Node& node, const std::string& registry)
    : node_(node), registry_(registry), directory_(node, registry, kRegistryDeadline) {}

const ObjectsView& ObjectWatch::look() {
  const auto entries = directory_.list();
  if (!entries) {
    view_.registry = {false, entries.error().reason()};
    return view_;
  }
  view_.registry = {true, {}};
  std::vector<std::string> names;
  for (const names::NameEntry& entry : *entries)
    names.push_back(entry.name);
  look_for_lapsed(std::exchange(names_, names) != names);
  std::map<std::string, std::string> fingerprints;
  for (const names::NameEntry& entry : *entries) {
    const auto url = wire::parse_url(entry.url);
    if (!url) continue;
    fingerprints[url->authority()] +=
        entry.name + "=" + entry.url + "#" + std::to_string(entry.revision) + ";";
  }
  std::erase_if(servers_, [&](const auto& one) { return !fingerprints.contains(one.first); });
  std::vector<ObjectView> objects;
  for (const names::NameEntry& entry : *entries) {
    const auto url = wire::parse_url(entry.url);
    if (!url || objects.size() >= kObjectCountMax) continue;
    const std::string& service = entry.service_url.empty() ? registry_ : entry.service_url;
    objects.push_back({entry.name, entry.interface, entry.url, service});
    const std::string key = url->authority();
    Server& server = servers_[key];
    if (server.fingerprint != fingerprints[key] || rt::now() >= server.next) {
      server.fingerprint = fingerprints[key];
      ask(server, names::reachable_url(entry).value_or(entry.url));
    }
    const std::string below = url->path + "/";
    for (const auto& [path, interface] : server.interfaces) {
      if (!path.starts_with(below)) continue;
      const std::string suffix = path.substr(url->path.size());
      objects.push_back({entry.name + suffix, interface, entry.url + suffix, service});
    }
  }
  std::ranges::sort(objects, {}, &ObjectView::name);
  view_.objects = std::move(objects);
  return view_;
}

void ObjectWatch::look_for_lapsed(bool has_changed) {
  if (!has_changed && rt::now() < next_lapsed_) return;
  next_lapsed_ = rt::now() + kLapsedInterval;
  names::LapsedAnswer answer =
      names::ask_for_lapsed(node_, registry_, rt::now() + kRegistryDeadline);
  view_.lapsed = std::move(answer.names);
  view_.lapsed_services = std::move(answer.services);
}

void ObjectWatch::ask(Server& server, const std::string& url) {
  server.next = rt::now() + kCatalogInterval;
  rpc::BindOptions options;
  options.deadline = kCatalogDeadline;
  auto catalog =
      introspection::IntrospectionClient::bind(node_, dynamic::catalog_url(url), options);
  if (!catalog) return;
  rpc::CallOptions call;
  call.deadline = kCatalogDeadline;
  const auto objects = catalog->list({}, call);
  if (!objects) return;
  server.interfaces.clear();
  for (const auto* object : *(*objects)->objects())
    server.interfaces[object->path()->str()] = object->interface()->str();
}

}  // namespace rtpm::console
