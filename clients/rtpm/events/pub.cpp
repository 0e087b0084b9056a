#include <algorithm>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "events/commands.hpp"
#include "objects/unbound.hpp"
#include "rtpm/capture/event_schemas.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::tool {
namespace {

struct PubRequest {
  std::string hub{events::kHubPath};
  std::string type{};
  std::string json{};
  events::SourceId source = 0;
  double rate_hz = 0;       ///< If 0, a single event.
  std::uint64_t count = 0;  ///< The number of events at that rate; if 0, endless.
};

std::string unknown_type(const events::HubTypes& types, const std::string& name) {
  std::vector<std::string> names;
  for (const events::EventDescriptor* type : types.list())
    names.emplace_back(type->name);
  return "the hub knows no type '" + name + "'" + program::suggestion(name, names) +
         "; it learns them from suppliers and consumers";
}

/// Pushes events at the rate. @return the number pushed, or why no more could be pushed
expected<std::uint64_t, SetupError> push(Context& context, events::Supplier& supplier,
                                         const PubRequest& request,
                                         const events::EventDraft& draft) {
  const program::StopSignal& stop = context.stop();
  const MonotonicTime begin = rt::now();
  const std::uint64_t count_max = request.rate_hz == 0 ? 1
                                  : request.count == 0 ? UINT64_MAX
                                                       : request.count;
  for (std::uint64_t count = 0; count < count_max;) {
    if (const auto pushed = supplier.push(draft); !pushed) {
      return setup_error("event " + std::to_string(count + 1) + " was not pushed",
                         rpc::make_error_code(pushed.error()));
    }
    ++count;
    if (count == count_max) return count;
    const auto next = begin + std::chrono::duration_cast<Duration>(std::chrono::duration<double>(
                                  static_cast<double>(count) / request.rate_hz));
    if (stop.wait_for(next - rt::now())) return count;
  }
  return count_max;
}

int pub(Context& context, const PubRequest& request) {
  static_cast<void>(context.stop());
  const Duration deadline = context.deadline.value_or(std::chrono::seconds{1});
  const auto types = events::HubTypes::ask(context.node(), request.hub, deadline);
  if (!types) {
    return context.not_reached(with_similar_names(context, request.hub, types.error()));
  }
  const auto type = std::ranges::find(types->list(), request.type, &events::EventDescriptor::name);
  if (type == types->list().end()) return context.fail(unknown_type(*types, request.type));
  capture::EventSchemas schemas;
  schema::Dynamic* const dynamic = schemas.find(*type);
  if (dynamic == nullptr) {
    return context.fail("the hub has no schema of " + request.type +
                        ", so no payload can be made of JSON");
  }
  std::string error;
  const auto payload = dynamic->encode(dynamic->event(), request.json, error);
  if (!payload) return context.fail({"the payload does not fit the schema", error});
  events::SupplierConfig config{.name = "rtpm pub", .types = {*type}, .deadline = deadline};
  config.priority = context.priority.value_or(Priority{});
  const auto supplier = events::Supplier::create(context.node(), request.hub, config);
  if (!supplier) return context.fail(supplier.error());
  const auto count = push(context, **supplier, request,
                          {.type = (*type)->type,
                           .source = request.source,
                           .schema_id = (*type)->schema_id,
                           .payload = *payload});
  if (!count) return context.fail(count.error());
  if (context.json) {
    print_json({{"type", request.type}, {"source", request.source}, {"count", *count}});
  } else {
    print_line(std::to_string(*count) + (*count == 1 ? " event was" : " events were") + " pushed");
  }
  return kDone;
}

}  // namespace

void add_pub(CLI::App& program, Context& context) {
  const auto request = std::make_shared<PubRequest>();
  CLI::App& command =
      add_command(program, context, "pub", "Push an event, made of JSON, to a hub",
                  "  rtpm pub lab.Touched '{force: {z: 2.5}}' --source 3\n"
                  "  rtpm pub lab.Touched '{}' --rate 100 --count 1000\n"
                  "The type is one that the hub knows; absent fields have their defaults.\n",
                  [request](Context& c) { return pub(c, *request); });
  command.add_option("TYPE", request->type, "The event's type, 'lab.Touched'")
      ->required()
      ->type_name("");
  command.add_option("JSON", request->json, "The payload")->type_name("");
  command.add_option("--hub", request->hub, "The hub, by name or URL")->capture_default_str();
  add_count(command, "--source", request->source, "The source's number");
  command.add_option("--rate", request->rate_hz, "Events per second; 0: one event")
      ->check(CLI::Range(0.0, 100'000.0))
      ->capture_default_str();
  add_count(command, "--count", request->count, "With --rate: how many; 0: until Ctrl-C");
}

}  // namespace rtpm::tool
