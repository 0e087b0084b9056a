#include <cstdio>
#include <string>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "objects/commands.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/names/directory.hpp"

namespace rtpm::tool {
namespace {

struct CallRequest {
  std::string target{};
  std::string method{};
  std::string json{};
  std::optional<Duration> stream_time{};
};

bool is_stream_of(dynamic::RemoteObject& object, const std::string& method) {
  const schema::Method* const found = object.dynamic().find(method);
  return found != nullptr && found->is_stream;
}

int call(Context& context, const CallRequest& request) {
  const auto url = names::url_of(context.node(), context.registry, request.target);
  if (!url) return context.not_reached(url.error());
  const std::string calling = "calling " + printable(request.target);
  const auto object =
      awaited(context, calling, [&] { return dynamic::RemoteObject::open(context.node(), *url); });
  if (!object) return context.not_reached(object.error());
  const auto call_with = [&](const dynamic::RemoteObject::Print& print) {
    return (*object)->call(request.method, request.json, context.call_options(),
                           request.stream_time, print);
  };
  std::string reply;
  const auto called = is_stream_of(**object, request.method)
                          // Ctrl-C closes a stream explicitly, so that its server frees it at once.
                          ? call_with([&stop = context.stop()](std::string_view text) {
                              if (!text.empty()) print_line(printable(text, kShownWhole));
                              return !stop.is_requested();
                            })
                          : awaited(context, calling, [&] {
                              return call_with([&reply](std::string_view text) {
                                reply = text;
                                return true;
                              });
                            });
  if (!called) return context.fail(named(request.method, called.error()));
  if (!reply.empty()) print_line(printable(reply, kShownWhole));
  return kDone;
}

}  // namespace

void add_call(CLI::App& program, Context& context) {
  const auto request = std::make_shared<CallRequest>();
  CLI::App& command = add_command(
      program, context, "call", "Call a method, and print its reply or its items as JSON",
      "  rtpm call lab/arm0 read\n  rtpm call lab/arm0 lease_state '{lease: 1}'\n"
      "The request has the fields of its table, as `rtpm info --schema` shows them; where that is\n"
      "one struct, those of the struct will do, all of them. Other absent fields have their\n"
      "defaults.\n"
      "A oneway waits as its schema says. A stream's items are printed as they come, until it\n"
      "ends, for --for, or until Ctrl-C.\n",
      [request](Context& c) { return call(c, *request); });
  add_target(command, request->target);
  command.add_option("METHOD", request->method, "As `rtpm info TARGET` shows them")
      ->required()
      ->type_name("");
  command.add_option("JSON", request->json, "The request")->type_name("");
  add_duration(command, "--for", request->stream_time,
               "How long a stream is read; without: until it ends, or Ctrl-C",
               {Duration{0}, std::chrono::hours{24}});
}

}  // namespace rtpm::tool
