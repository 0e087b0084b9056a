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
constexpr Duration kEffectPatience = std::chrono::seconds{2};
constexpr Duration kEffectInterval = std::chrono::milliseconds{5};

struct TakeOverRequest {
  std::string device{};
  std::string transition{};
  std::optional<Duration> time{};
};

bool is_active(const driver::Sample& sample) {
  return sample.lifecycle == driver::Lifecycle::kActive;
}
bool is_inactive(const driver::Sample& sample) {
  return sample.lifecycle == driver::Lifecycle::kInactive;
}
bool is_recovered(const driver::Sample& sample) {
  return !sample.faults.has(driver::Fault::kCommandNotFinite) &&
         !sample.faults.has(driver::Fault::kTooFast);
}
bool is_rearmed(const driver::Sample& sample) {
  return !sample.faults.has(driver::Fault::kEmergencyStop);
}

/// Describes the device for people.
std::string standing_of(const driver::Sample& sample) {
  return "it is " + std::string(to_string(sample.lifecycle)) +
         ", faults: " + to_text(sample.faults);
}

/// Describes the obstacle to the force of a recovered device; empty if nothing stops it.
std::string obstacle_of(const driver::Sample& sample) {
  if (sample.faults.has(driver::Fault::kEmergencyStop)) {
    return "no fault is latched, but the emergency stop holds its force back; to end it: rtpm "
           "take-over DEVICE rearm";
  }
  return is_active(sample) ? std::string() : "no fault is latched, but " + standing_of(sample);
}

struct Transition {
  std::string_view name{};
  gvd::DeviceResult (gvd::DeviceClient::*run)() = nullptr;
  bool (*has_effect)(const driver::Sample& sample) = nullptr;
  const char* state = "";  ///< The state in JSON.
  const char* sentence = "";
  /// Describes a state that makes the sentence untrue; empty if there is none.
  std::string (*obstacle)(const driver::Sample& sample) = nullptr;
};
constexpr std::array kTransitions{
    Transition{"recover", &gvd::DeviceClient::recover, &is_recovered, "recovered",
               "has recovered: no fault holds its force back", &obstacle_of},
    Transition{"activate", &gvd::DeviceClient::activate, &is_active, "active", "is active"},
    Transition{"deactivate", &gvd::DeviceClient::deactivate, &is_inactive, "inactive",
               "is inactive: it applies no force until it is activated"},
    Transition{"rearm", &gvd::DeviceClient::rearm, &is_rearmed, "rearmed",
               "is rearmed: the emergency stop is over, and commands count again"}};

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

/// Requests the transition, and waits until the device's samples show it.
/// @return the exit code
int perform(Context& context, gvd::DeviceClient& device, const std::string& name,
            const Transition& transition) {
  const std::string prefix = std::string(transition.name) + ": ";
  if (const auto done = (device.*transition.run)(); !done) {
    return fail(context, name, prefix + std::string(to_string(done.error())));
  }
  const MonotonicTime end = rt::now() + kEffectPatience;
  while (true) {
    const auto sample = device.read();
    if (sample && transition.has_effect(*sample)) {
      const std::string obstacle = transition.obstacle ? transition.obstacle(*sample) : "";
      if (!obstacle.empty()) return fail(context, name, prefix + obstacle);
      tell(context, name, transition.state, transition.sentence);
      return kDone;
    }
    if (rt::now() >= end) {
      return fail(context, name,
                  prefix + "the device took the request and shows no effect after 2 s; " +
                      (sample ? standing_of(*sample) : std::string(to_string(sample.error()))));
    }
    rt::sleep_until(rt::now() + kEffectInterval);
  }
}

/// Releases the lease.
/// @return the exit code
int release(Context& context, gvd::DeviceClient& device, const std::string& name) {
  if (const auto released = device.release(); !released) {
    return fail(context, name, to_string(released.error()));
  }
  tell(context, name, "free", "is free: the right to command was given back");
  return kDone;
}

/// Holds the lease for the requested time, or until the device ends it.
int hold(Context& context, gvd::DeviceClient& device, const TakeOverRequest& request) {
  const MonotonicTime until = request.time ? rt::now() + *request.time : kNever;
  while (rt::now() < until && !context.stop().wait_for(kRenewal)) {
    const auto renewed = device.renew();
    if (renewed) continue;
    const auto state = device.lease_state();
    if (renewed.error() != gvd::DeviceOutcome::kNotHolder || !state) {
      return fail(context, request.device, to_string(renewed.error()));
    }
    return fail(context, request.device, "is not held any more: " + std::string(to_string(*state)));
  }
  return release(context, device, request.device);
}

int take_over(Context& context, const TakeOverRequest& request) {
  // From here on, Ctrl-C releases the lease.
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
    const int code = perform(context, *device, request.device, *transition);
    if (code != kDone) return code;
    if (!request.time) return release(context, *device, request.device);
  }
  return hold(context, *device, request);
}

}  // namespace

void add_take_over(CLI::App& program, Context& context) {
  const auto request = std::make_shared<TakeOverRequest>();
  CLI::App& command = add_command(
      program, context, "take-over", "Take the right to command a device from its holder",
      "  rtpm take-over lab/arm0              hold it without force until Ctrl-C\n"
      "  rtpm take-over lab/arm0 rearm        end its emergency stop, and give it back\n"
      "The former holder's force goes to zero. The device is held without force for --for, or "
      "until\n"
      "Ctrl-C; with a transition and without --for it is given back once it shows that "
      "transition.\n"
      "The call's --priority is the device's --operator-priority, or above; if none is given, it "
      "is\n"
      "that.\n",
      [request](Context& c) { return take_over(c, *request); });
  add_target(command, request->device, "DEVICE");
  command.add_option("TRANSITION", request->transition, "recover, activate, deactivate or rearm")
      ->check(CLI::IsMember({"recover", "activate", "deactivate", "rearm"}))
      ->type_name("");
  add_duration(command, "--for", request->time,
               "How long it is held; without: until Ctrl-C or the transition",
               {Duration{0}, std::chrono::hours{24}});
}

}  // namespace rtpm::tool
