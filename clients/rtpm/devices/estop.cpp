#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <string_view>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "devices/commands.hpp"
#include "objects/unbound.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/gvd/stop_delivery.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {
namespace {

/// The interval between attempts to deliver a stop; each takes up to StopDeliveryConfig::patience.
constexpr Duration kRetryInterval = std::chrono::milliseconds{100};

struct EstopRequest {
  std::string device{};
  std::string scope = "device";
  Duration wait = std::chrono::seconds{10};
};

struct Scope {
  std::string_view name{};
  gvd::StopScope scope{};
  const char* what = "";
};
constexpr std::array kScopes{Scope{"device", gvd::StopScope::kDevice, ""},
                             Scope{"server", gvd::StopScope::kServer, ", and all of its server"},
                             Scope{"system", gvd::StopScope::kSystem, ", and all of its system"}};

const Scope& scope_of(const EstopRequest& request) {
  return *std::ranges::find(kScopes, request.scope, &Scope::name);
}

/// Prints which devices a stop has reached, and which not.
class Teller {
 public:
  Teller(const Context& context, const EstopRequest& request)
      : context_(context), request_(request) {}

  void tell(const gvd::StopReport& report) {
    std::map<std::string, std::size_t> target_counts;
    for (const gvd::StopResult& result : report.devices)
      ++target_counts[result.target.device];
    for (const gvd::StopResult& result : report.devices)
      tell(result, target_counts[result.target.device] > 1);
    for (const std::string& note : report.notes)
      rt::print_error("rtpm", note);
  }

  /// Prints the result of a retry: only the devices that it stopped.
  void tell_stopped(const gvd::StopReport& report) {
    for (const gvd::StopResult& result : report.devices) {
      if (result.is_stopped) tell(result, /*is_bound_twice=*/true);
    }
  }

 private:
  void tell(const gvd::StopResult& result, bool is_bound_twice) const {
    const gvd::StopTarget& target = result.target;
    if (context_.json) {
      Json json{{"device", target.device}, {"url", target.url}, {"is_stopped", result.is_stopped}};
      if (!result.why.empty()) json["why"] = result.why;
      return print_json(json);
    }
    const bool is_named = !request_.device.empty();
    const std::string where = is_bound_twice && target.url != target.device
                                  ? " at " + printable(target.url)
                                  : std::string{};
    if (!result.is_stopped) {
      context_.fail(
          {target.device + where + " is NOT stopped", result.why, "use the hardware stop"});
    } else if (is_named && !result.why.empty()) {
      context_.fail({target.device + where, result.why});
    } else {
      print_line(printable(target.device) + where + " is stopped" +
                 (is_named ? std::string(scope_of(request_).what) + "; `rtpm take-over " +
                                 printable(target.device) + " rearm` ends that of a device"
                           : std::string{}));
    }
  }

  const Context& context_;
  const EstopRequest& request_;
};

/// Reports that there was nothing to stop, and why.
int tell_none(Context& context, const std::string& device, const gvd::StopReport& report) {
  if (report.search_error) {
    return context.not_reached(named(device.empty() ? "the system" : device, *report.search_error));
  }
  if (!device.empty()) {
    const SetupError none{"no name service has it"};
    return context.not_reached(named(device, with_similar_names(context, device, none)));
  }
  const auto entries = names::Directory(context.node(), context.registry).list();
  if (!entries) return context.not_reached(named("the system", entries.error()));
  return context.fail("the system: the registry names no device");
}

/// Retries until all are stopped, the time is up, or Ctrl-C.
void retry(Context& context, const EstopRequest& request, gvd::StopDelivery& delivery,
           Teller& teller) {
  const MonotonicTime end = rt::now() + request.wait;
  if (delivery.owed().empty() || rt::now() >= end) return;
  if (!context.json) {
    rt::print_error("rtpm", "goes on trying for " +
                                program::formatted(
                                    "%.0f s", std::chrono::duration<double>(request.wait).count()) +
                                "; Ctrl-C ends it");
  }
  do {
    teller.tell_stopped(delivery.retry());
  } while (!delivery.owed().empty() && rt::now() < end && !context.stop().wait_for(kRetryInterval));
}

int estop(Context& context, const EstopRequest& request) {
  // Called before any thread starts, so that Ctrl-C ends the waiting cleanly.
  static_cast<void>(context.stop());
  gvd::StopDelivery delivery(context.node(), {.where = context.registry});
  const gvd::StopReport report = delivery.stop(request.device, scope_of(request).scope);
  if (report.devices.empty()) return tell_none(context, request.device, report);
  Teller teller(context, request);
  teller.tell(report);
  const std::size_t all_count = report.devices.size();
  retry(context, request, delivery, teller);
  const std::size_t stopped_count = all_count - std::min(all_count, delivery.owed().size());
  if (request.device.empty() && !context.json) {
    const std::string hubs =
        std::to_string(report.told_hub_count) + (report.told_hub_count == 1 ? " hub" : " hubs");
    print_line(std::to_string(stopped_count) + " of " + std::to_string(all_count) +
               " devices are stopped" +
               (report.told_hub_count > 0 ? ", and all others at " + hubs + " are told" : ""));
  }
  if (stopped_count == 0) return kNotReached;
  const bool is_half = !request.device.empty() &&
                       std::ranges::any_of(report.devices, [](const gvd::StopResult& result) {
                         return result.is_stopped && !result.why.empty();
                       });
  return stopped_count == all_count && report.notes.empty() && !is_half ? kDone : kFailed;
}

}  // namespace

void add_estop(CLI::App& program, Context& context) {
  const auto request = std::make_shared<EstopRequest>();
  CLI::App& command = add_command(
      program, context, "estop", "Emergency stop: take the force of devices away at once",
      "  rtpm estop                    every device that a name service has, and all others of\n"
      "                                their system\n"
      "  rtpm estop lab/arm0 server    this one, and all of its server\n"
      "Stops at every server to which a name leads, also where it is bound twice or LOST, and\n"
      "through every hub. It answers within a second; --wait says for how long it goes on trying\n"
      "what is not reached by then.\n"
      "Exit code 0: all are stopped, 1: some, or not every name service and hub was reached, 3:\n"
      "none. Needs no right to command. They stay stopped until `rtpm take-over DEVICE rearm`.\n",
      [request](Context& c) { return estop(c, *request); });
  add_target(command, request->device, "DEVICE").required(false);
  command.add_option("SCOPE", request->scope, "device, server or system")
      ->check(CLI::IsMember({"device", "server", "system"}))
      ->capture_default_str()
      ->type_name("");
  add_duration(command, "--wait", request->wait,
               "How long to try again what is not reached at first",
               {Duration{0}, std::chrono::hours{24}});
}

}  // namespace rtpm::tool
