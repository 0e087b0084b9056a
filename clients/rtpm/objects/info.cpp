#include <cstdio>
#include <device.rtpm.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "cli/table.hpp"
#include "devices/device_facts.hpp"
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

struct InfoRequest {
  std::string target{};
  bool is_schema = false;
};

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

/// The methods in one line: "read, command (oneway), watch (stream)".
std::string methods_text(const schema::Service& service) {
  std::string text;
  for (const schema::Method& method : service.methods) {
    text += (text.empty() ? "" : ", ") + printable(method.name);
    if (const std::string kind = kind_of(method); kind != "call") text += " (" + kind + ")";
  }
  return text;
}

std::string parameters_text(const std::string& target,
                            const gvd::DeviceConfiguration& configuration) {
  return std::to_string(configuration.parameters.size()) + ", revision " +
         std::to_string(configuration.revision) + (configuration.is_unsaved ? ", not saved" : "") +
         ": rtpm config list " + printable(target);
}

/// A screen about an object.
std::string facts_text(const std::string& target, const std::string& url,
                       dynamic::RemoteObject& object,
                       const std::vector<names::Property>& properties, const DeviceFacts* device,
                       const gvd::DeviceConfiguration* configuration) {
  const schema::Service& service = object.dynamic().service();
  FactLines lines{{"interface", printable(service.name)}, {"at", printable(url)}};
  if (device != nullptr) {
    for (auto& line : lines_of(*device))
      lines.push_back(std::move(line));
  } else {
    for (const std::string& property : lines_of(properties))
      lines.emplace_back("property", property);
  }
  if (configuration != nullptr) {
    lines.emplace_back("parameters", parameters_text(target, *configuration));
  }
  lines.emplace_back("methods", methods_text(service));
  lines.emplace_back("schema", "rtpm info " + printable(target) + " --schema");
  constexpr std::size_t kLabel = 12;
  std::string text = coloured(printable(target), Colour::kBold) + "\n";
  for (const auto& [label, fact] : lines) {
    const std::string head =
        coloured(label, Colour::kGrey) + std::string(kLabel - label.size(), ' ');
    text += hanging(head, kLabel, fact, terminal_width());
  }
  return text;
}

int info(Context& context, const InfoRequest& request) {
  const std::string& target = request.target;
  const auto url = names::url_of(context.node(), context.registry, target);
  if (!url) return context.not_reached(with_loss(context, target, url.error()));
  const Duration stale_for = staleness_of(context, target);
  const std::string asking = "asking " + printable(target);
  const auto object =
      awaited(context, asking, [&] { return dynamic::RemoteObject::open(context.node(), *url); });
  if (!object) return context.not_reached(object.error());
  const auto device = awaited(context, asking, [&] { return configuration_of(context, *url); });
  if (!device) return context.fail(device.error());
  const std::vector<names::Property> properties = bound_properties_of(context, target);
  std::optional<DeviceFacts> facts;
  const bool is_device =
      (*object)->dynamic().service().name == device::DeviceClient::interface().name;
  if (is_device && !request.is_schema) {
    auto asked = awaited(context, asking, [&] { return device_facts_of(context, *url); });
    if (!asked) return context.not_reached(asked.error());
    facts = std::move(*asked);
  }
  if (context.json) {
    Json json = object_json(*url, **object, properties, *device ? &**device : nullptr);
    if (facts) json["device"].update(json_of(*facts));
    if (stale_for > Duration{0}) {
      json["stale_s"] = std::chrono::duration<double>(stale_for).count();
    }
    print_json(json);
    return kDone;
  }
  if (!request.is_schema) {
    const std::string text = facts_text(target, *url, **object, properties,
                                        facts ? &*facts : nullptr, *device ? &**device : nullptr);
    std::fputs(text.c_str(), stdout);
    return kDone;
  }
  std::fputs(printable_lines((*object)->schema()).c_str(), stdout);
  std::fputs(properties_comment(properties).c_str(), stdout);
  if (*device) std::fputs(as_comment(**device).c_str(), stdout);
  return kDone;
}

}  // namespace

void add_info(CLI::App& program, Context& context) {
  const auto request = std::make_shared<InfoRequest>();
  CLI::App& command = add_command(
      program, context, "info",
      "Show an object: its methods, and a device's class, limits, state and lease",
      "  rtpm info lab/arm0\n"
      "  rtpm info lab/arm0 --schema > arm.fbs\n"
      "The schema is one that rtpmc takes; the name's properties and the device's parameters are\n"
      "comments in it.\n",
      [request](Context& c) { return info(c, *request); });
  add_target(command, request->target);
  command.add_flag("--schema", request->is_schema, "Print its schema");
}

}  // namespace rtpm::tool
