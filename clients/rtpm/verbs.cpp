#include "verbs.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <initializer_list>
#include <memory>
#include <string_view>

#include "config_verbs.hpp"
#include "device_verbs.hpp"
#include "host_verbs.hpp"
#include "remote.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/driver/parameter.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/options/stop_signal.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {
namespace {

int fail(const std::string& text) {
  rt::print_error("rtpm", text);
  return 1;
}

/// Prints remote text in columns, escaped.
void print_row(std::initializer_list<std::string_view> columns) {
  std::string line;
  for (const std::string_view column : columns)
    line += (line.empty() ? "" : "\t") + printable(column);
  std::puts(line.c_str());
}

/// list: the names in the registry.   list TARGET: the objects of that server.
int list(const Request& request) {
  if (request.arguments.empty()) {
    names::Directory directory(request.node, request.registry);
    const auto entries = directory.list();
    if (!entries) return fail(entries.error().text());
    for (const names::NameEntry& entry : *entries) {
      print_row({entry.name, entry.interface, entry.url});
    }
    return 0;
  }
  const auto url = url_of(request.node, request.registry, request.arguments[0]);
  if (!url) return fail(url.error().text());
  auto catalog = introspection::IntrospectionClient::bind(request.node, catalog_url(*url));
  if (!catalog) return fail(catalog.error().text());
  const auto reply = catalog->list();
  if (!reply) return fail(std::string(to_string(reply.error())));
  for (const auto* object : *(*reply)->objects()) {
    print_row({object->path()->string_view(), object->interface()->string_view()});
  }
  return 0;
}

int describe(const Request& request) {
  const auto url = url_of(request.node, request.registry, request.arguments[0]);
  if (!url) return fail(url.error().text());
  const auto object = RemoteObject::open(request.node, *url);
  if (!object) return fail(object.error().text());
  std::fputs(printable_lines((*object)->schema()).c_str(), stdout);
  const auto parameters = parameters_as_comment(request, *url);
  if (!parameters) return fail(parameters.error().text());
  std::fputs(parameters->c_str(), stdout);
  return 0;
}

bool is_stream_of(RemoteObject& object, const std::string& method) {
  const schema::Method* const found = object.dynamic().find(method);
  return found != nullptr && found->is_stream;
}

int call(const Request& request) {
  const auto url = url_of(request.node, request.registry, request.arguments[0]);
  if (!url) return fail(url.error().text());
  const auto object = RemoteObject::open(request.node, *url);
  if (!object) return fail(object.error().text());
  const std::string json = request.arguments.size() > 2 ? request.arguments[2] : std::string{};
  // Ctrl-C closes a stream explicitly, so that its server frees it at once.
  const bool is_stream = is_stream_of(**object, request.arguments[1]);
  const auto stop = is_stream ? std::make_unique<options::StopSignal>() : nullptr;
  const auto print = [&](std::string_view text) {
    if (!text.empty()) {
      std::puts(printable(text, kShownWhole).c_str());
      std::fflush(stdout);
    }
    return stop == nullptr || !stop->is_requested();
  };
  const auto called =
      (*object)->call(request.arguments[1], json, request.options, request.stream_time, print);
  if (!called) return fail(request.arguments[1] + ": " + called.error().text());
  return 0;
}

struct Verb {
  const char* name = "";
  std::size_t count_min = 0;  ///< Of arguments.
  std::size_t count_max = 0;
  const char* arguments = "";
  const char* help = "";
  const char* details = "";
  int (*run)(const Request&) = nullptr;
};

/// Of `config`: an action, a device, and a device's parameters.
constexpr std::size_t kConfigCountMax = 2 + driver::kParameterCountMax;

constexpr std::array kVerbs{
    Verb{"list", 0, 1, "[TARGET]", "List the registry's names, or a server's objects",
         "TARGET is an object of the server: a name in the registry, or a URL.\n", &list},
    Verb{"describe", 1, 1, "TARGET", "Print the schema of an object, and a device's parameters",
         "TARGET is a name in the registry, or a URL. The parameters are comments of the schema.\n",
         &describe},
    Verb{"call", 2, 3, "TARGET METHOD [JSON]", "Call a method, and print its reply or its items",
         "TARGET is a name in the registry, or a URL; JSON is the request, such as:\n"
         "  rtpm call lab/arm0 set_force '{x: 1}'\n"
         "A stream's items are printed as they come, until it ends, for --for, or until Ctrl-C.\n",
         &call},
    Verb{"take-over", 1, 2, "DEVICE [recover|activate|deactivate|rearm]",
         "Take the right to command a device from its holder",
         "The former holder's force goes to zero. The device is held without force for --for, "
         "until\n"
         "Ctrl-C, or until it frees itself of a holder that commands nothing. The call's "
         "--priority is\n"
         "the device's --operator-priority, or above; if none is given, it is that.\n",
         &take_over},
    Verb{"stop", 0, 2, "[DEVICE [device|server|system]]",
         "Emergency stop: take the force of devices away at once",
         "Needs no right to command. Without DEVICE: every device that the registry names, and all "
         "others\n"
         "of their system. They stay stopped until `rtpm take-over DEVICE rearm`.\n",
         &stop_devices},
    Verb{"flight-record", 1, 1, "DEVICE", "Print the cycles around a device's newest fault as CSV",
         "Each line is a cycle: what was measured, asked for, decided and applied.\n",
         &flight_record},
    Verb{"config", 2, kConfigCountMax, "list|get|set|save|reset|calibrate DEVICE ...",
         "Show, change, save and calibrate a device's parameters",
         "DEVICE is a name in the registry, or a URL.\n"
         "  rtpm config list lab/arm0                   every parameter, its range and default\n"
         "  rtpm config get lab/arm0 [NAME ...]         values as NAME=VALUE\n"
         "  rtpm config set lab/arm0 NAME=VALUE ...     all of these changes, or none\n"
         "  rtpm config reset lab/arm0 [NAME ...]       defaults, of no names all\n"
         "  rtpm config save lab/arm0                   for the next start of its server\n"
         "  rtpm config calibrate lab/arm0 [NAME]       a dialogue; without NAME: what there is\n"
         "With --revision N a change is refused if another came since; 'list' shows the revision.\n"
         "A calibration reads answers from standard input, or --answer has them; Ctrl-C cancels\n"
         "it. At its end it asks whether to keep the result, or --keep or --discard say so.\n",
         &config},
    Verb{"lanes", 0, 1, "[watch]", "Show what the lanes of this host's servers do",
         "With `watch`: again each second, until Ctrl-C.\n", &lanes},
    Verb{"doctor", 0, 0, "", "Show what this host gives to real-time programs",
         "Each thing that is missing has its remedy; then the exit code is 1.\n", &doctor},
};

const Verb& verb_named(const std::string& name) {
  const auto* const verb =
      std::ranges::find_if(kVerbs, [&](const Verb& candidate) { return candidate.name == name; });
  RTPM_ASSERT(verb != kVerbs.end(), "the options refuse other verbs");
  return *verb;
}

}  // namespace

void add_verbs(options::Options& options) {
  for (const Verb& verb : kVerbs)
    options.add_verb(verb.name, verb.arguments, verb.help, verb.details);
}

bool takes(const std::string& verb, std::size_t argument_count) {
  const Verb& found = verb_named(verb);
  return argument_count >= found.count_min && argument_count <= found.count_max;
}

int run(const std::string& verb, const Request& request) {
  return verb_named(verb).run(request);
}

}  // namespace rtpm::tool
