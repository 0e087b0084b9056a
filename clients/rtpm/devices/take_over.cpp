#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "devices/commands.hpp"
#include "devices/device.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::tool {
namespace {

constexpr Duration kRenewal = std::chrono::milliseconds{200};

struct TakeOverRequest {
  std::string device{};
  std::string transition{};
  std::optional<Duration> time{};
};

struct Transition {
  std::string_view name{};
  gvd::DeviceResult (gvd::DeviceClient::*run)() = nullptr;
};
constexpr std::array kTransitions{Transition{"recover", &gvd::DeviceClient::recover},
                                  Transition{"activate", &gvd::DeviceClient::activate},
                                  Transition{"deactivate", &gvd::DeviceClient::deactivate},
                                  Transition{"rearm", &gvd::DeviceClient::rearm}};

int fail(const Context& context, const std::string& device, std::string_view why) {
  return context.fail(device + ": " + std::string(why));
}

void tell(const Context& context, const std::string& device, const char* state,
          std::string_view sentence) {
  if (context.json) {
    print_json({{"device", device}, {"state", state}, {"why", sentence}});
  } else {
    print_line(printable(device) + " " + std::string(sentence));
  }
}

std::string why_not(const gvd::DeviceClient& device, gvd::DeviceError error) {
  if (error == gvd::DeviceOutcome::kBelowOperatorPriority) {
    return "calls of a priority below " + std::to_string(device.operator_priority().value()) +
           " do not take the right to command over; give a higher --priority, or none";
  }
  return "was not taken over: " + std::string(to_string(error));
}

/// Keeps the lease for the requested time, or until the device ends it.
int hold(Context& context, gvd::DeviceClient& device, const TakeOverRequest& request) {
  const MonotonicTime until = request.time ? rt::now() + *request.time : kNever;
  while (rt::now() < until && !context.stop().wait_for(kRenewal)) {
    const auto renewed = device.renew();
    if (renewed) continue;
    const auto state = device.lease_state();
    if (renewed.error() != gvd::DeviceOutcome::kNotHolder || !state) {
      return fail(context, request.device, to_string(renewed.error()));
    }
    tell(context, request.device, "free", "is free: " + std::string(to_string(*state)));
    return *state == gvd::LeaseState::kIdle ? kDone : kFailed;
  }
  if (const auto released = device.release(); !released) {
    return fail(context, request.device, to_string(released.error()));
  }
  tell(context, request.device, "free", "is free: the right to command was given back");
  return kDone;
}

int take_over(Context& context, const TakeOverRequest& request) {
  // Ctrl-C gives the lease back from here on.
  static_cast<void>(context.stop());
  auto device = open_device(context, request.device);
  if (!device) return context.not_reached(device.error());
  const bool has_priority = context.priority && *context.priority > Priority{0};
  const Priority priority = has_priority ? *context.priority : device->operator_priority();
  if (const auto taken = device->take_over(priority); !taken) {
    return fail(context, request.device, why_not(*device, taken.error()));
  }
  tell(context, request.device, "held",
       "was taken over: no client commands it, its force goes to zero");
  const auto* const transition =
      std::ranges::find(kTransitions, request.transition, &Transition::name);
  if (transition != kTransitions.end()) {
    if (const auto done = ((*device).*(transition->run))(); !done) {
      return fail(context, request.device,
                  request.transition + ": " + std::string(to_string(done.error())));
    }
  }
  return hold(context, *device, request);
}

}  // namespace

void add_take_over(CLI::App& program, Context& context) {
  const auto request = std::make_shared<TakeOverRequest>();
  CLI::App& command = add_command(
      program, context, "take-over", "Take the right to command a device from its holder",
      "  rtpm take-over lab/arm0 deactivate --for 2s\n"
      "The former holder's force goes to zero. The device is held without force for --for, until\n"
      "Ctrl-C, or until it frees itself of a holder that commands nothing. The call's --priority "
      "is\n"
      "the device's --operator-priority, or above; if none is given, it is that.\n",
      [request](Context& c) { return take_over(c, *request); });
  add_target(command, request->device, "DEVICE");
  command.add_option("TRANSITION", request->transition, "recover, activate, deactivate or rearm")
      ->check(CLI::IsMember({"recover", "activate", "deactivate", "rearm"}))
      ->type_name("");
  add_duration(command, "--for", request->time, "How long it is held; without: until Ctrl-C",
               {Duration{0}, std::chrono::hours{24}});
}

}  // namespace rtpm::tool
