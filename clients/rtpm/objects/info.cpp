#include <cstdio>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "devices/parameters.hpp"
#include "objects/commands.hpp"
#include "objects/entries.hpp"
#include "objects/unbound.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::tool {
namespace {

const char* kind_of(const schema::Method& method) {
  if (method.is_stream) return "stream";
  return method.oneway ? "oneway" : "call";
}

Json method_json(const schema::Method& method) {
  Json json{{"name", method.name},
            {"id", method.id},
            {"kind", kind_of(method)},
            {"is_idempotent", method.is_idempotent}};
  if (method.deadline_us) json["deadline_us"] = *method.deadline_us;
  if (method.max_size) json["size_max"] = *method.max_size;
  return json;
}

/// The properties of a name; a URL has none.
std::vector<names::Property> bound_properties_of(Context& context, const std::string& target) {
  if (wire::is_url(target)) return {};
  names::Directory directory(context.node(), context.registry);
  const auto entry = directory.describe(target);
  return entry ? entry->properties : std::vector<names::Property>{};
}

std::string properties_comment(const std::vector<names::Property>& properties) {
  if (properties.empty()) return {};
  std::string text = "\n// The properties of this name (rtpm find --where):\n";
  for (const std::string& line : lines_of(properties))
    text += "//   " + line + "\n";
  return text;
}

Json object_json(const std::string& url, dynamic::RemoteObject& object,
                 const std::vector<names::Property>& properties,
                 const gvd::DeviceConfiguration* device) {
  const schema::Service& service = object.dynamic().service();
  Json methods = Json::array();
  for (const schema::Method& method : service.methods)
    methods.push_back(method_json(method));
  Json json{{"url", url},
            {"interface", service.name},
            {"fingerprint", service.fingerprint},
            {"compiler_version", object.compiler_version()},
            {"methods", std::move(methods)},
            {"schema", object.schema()}};
  json.update(properties_json(properties));
  if (device != nullptr) json["device"] = json_of(*device);
  return json;
}

// How out of date the registry is, if the target is a name; also warns about it.
Duration staleness_of(Context& context, const std::string& target) {
  if (wire::parse_url(target)) return {};
  const auto entry = names::Directory(context.node(), context.registry).entry_of(target);
  if (!entry) return {};
  warn_if_stale(entry->stale_for);
  return entry->stale_for;
}

int info(Context& context, const std::string& target) {
  const auto url = names::url_of(context.node(), context.registry, target);
  if (!url) return context.not_reached(with_loss(context, target, url.error()));
  const Duration stale_for = staleness_of(context, target);
  const auto object = dynamic::RemoteObject::open(context.node(), *url);
  if (!object) return context.not_reached(object.error());
  const auto device = configuration_of(context, *url);
  if (!device) return context.fail(device.error());
  const std::vector<names::Property> properties = bound_properties_of(context, target);
  if (context.json) {
    Json json = object_json(*url, **object, properties, *device ? &**device : nullptr);
    if (stale_for > Duration{0}) {
      json["stale_s"] = std::chrono::duration<double>(stale_for).count();
    }
    print_json(json);
    return kDone;
  }
  std::fputs(printable_lines((*object)->schema()).c_str(), stdout);
  std::fputs(properties_comment(properties).c_str(), stdout);
  if (*device) std::fputs(as_comment(**device).c_str(), stdout);
  return kDone;
}

}  // namespace

void add_info(CLI::App& program, Context& context) {
  const auto target = std::make_shared<std::string>();
  CLI::App& command = add_command(
      program, context, "info",
      "Print an object's schema, its name's properties and a device's parameters",
      "  rtpm info lab/arm0\n"
      "The output is a schema that rtpmc takes; properties and parameters are comments in it.\n",
      [target](Context& c) { return info(c, *target); });
  add_target(command, *target);
}

}  // namespace rtpm::tool
