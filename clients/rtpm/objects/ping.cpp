#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "objects/commands.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/clock_sync.hpp"

namespace rtpm::tool {
namespace {

using program::formatted;

struct PingRequest {
  std::string target{};
  std::uint64_t count = 0;  ///< 0 to run until Ctrl-C.
  Duration interval = std::chrono::seconds{1};
};

double microseconds(Duration duration) {
  return std::chrono::duration<double, std::micro>(duration).count();
}

/// The round trips so far.
struct Trips {
  std::vector<Duration> times{};
  std::uint64_t lost_count = 0;

  /// A quantile of the sorted round-trip times.
  [[nodiscard]] Duration at(double fraction) const {
    return times[static_cast<std::size_t>(fraction * static_cast<double>(times.size() - 1) + 0.5)];
  }
};

bool is_known(const wire::PeerClock& clock) {
  return clock.uncertainty != Duration::max();
}

void tell_trip(const Context& context, const std::string& target, std::uint64_t number,
               Duration time, const wire::PeerClock& clock) {
  if (context.json) {
    Json json{{"target", target}, {"number", number}, {"time_us", microseconds(time)}};
    if (is_known(clock)) {
      json["clock_offset_us"] = microseconds(clock.offset);
      json["clock_uncertainty_us"] = microseconds(clock.uncertainty);
    }
    print_json(json);
    return;
  }
  std::string line = formatted("%s: %llu: %.1f us", printable(target).c_str(),
                               static_cast<unsigned long long>(number), microseconds(time));
  if (is_known(clock)) {
    line += formatted(", clock %+.1f ± %.1f us", microseconds(clock.offset),
                      microseconds(clock.uncertainty));
  }
  print_line(line);
}

void tell_loss(const Context& context, const std::string& target, std::uint64_t number,
               rpc::CallError error) {
  if (context.json) {
    print_json({{"target", target}, {"number", number}, {"error", to_string(error)}});
  } else {
    print_line(printable(target) + ": " + std::to_string(number) + ": " +
               std::string(to_string(error)));
  }
}

void tell_summary(const Context& context, const std::string& target, Trips& trips) {
  std::ranges::sort(trips.times);
  const std::uint64_t count = trips.times.size() + trips.lost_count;
  if (context.json) {
    Json json{{"target", target}, {"count", count}, {"lost_count", trips.lost_count}};
    if (!trips.times.empty()) {
      json["time_us"] = {{"min", microseconds(trips.at(0))},
                         {"p50", microseconds(trips.at(0.5))},
                         {"p99", microseconds(trips.at(0.99))},
                         {"max", microseconds(trips.at(1))}};
    }
    print_json({{"summary", std::move(json)}});
    return;
  }
  std::string line = formatted("\n%llu pings, %llu lost", static_cast<unsigned long long>(count),
                               static_cast<unsigned long long>(trips.lost_count));
  if (!trips.times.empty()) {
    line += formatted("; min %.1f, p50 %.1f, p99 %.1f, max %.1f us", microseconds(trips.at(0)),
                      microseconds(trips.at(0.5)), microseconds(trips.at(0.99)),
                      microseconds(trips.at(1)));
  }
  print_line(line);
}

int ping(Context& context, const PingRequest& request) {
  const program::StopSignal& stop = context.stop();
  const auto url = names::url_of(context.node(), context.registry, request.target);
  if (!url) return context.not_reached(url.error());
  // Any object: a ping is the session's own (hp-6.2), and needs nothing of the server's catalog.
  static const rpc::InterfaceDescriptor kAnyInterface{};
  auto object = rpc::Binding::bind(context.node(), *url, kAnyInterface);
  if (!object) return context.not_reached(object.error());
  Trips trips;
  for (std::uint64_t number = 1;; ++number) {
    const MonotonicTime begin = rt::now();
    const auto clock = object->ping(context.call_options());
    const Duration time = rt::now() - begin;
    if (clock) {
      trips.times.push_back(time);
      tell_trip(context, request.target, number, time, *clock);
    } else {
      ++trips.lost_count;
      tell_loss(context, request.target, number, clock.error());
    }
    if (number == request.count || stop.wait_for(request.interval - (rt::now() - begin))) break;
  }
  tell_summary(context, request.target, trips);
  return trips.times.empty() ? kFailed : kDone;
}

}  // namespace

void add_ping(CLI::App& program, Context& context) {
  const auto request = std::make_shared<PingRequest>();
  CLI::App& command = add_command(
      program, context, "ping", "Measure the way to a server and back, and its clock's offset",
      "  rtpm ping lab/arm0 --count 1000 --interval 1ms\n"
      "The offset is the server's clock minus ours; the true one is within the uncertainty.\n",
      [request](Context& c) { return ping(c, *request); });
  add_target(command, request->target);
  add_count(command, "--count", request->count, "How many; 0: until Ctrl-C");
  add_duration(command, "--interval", request->interval, "From one to the next",
               {std::chrono::microseconds{100}, std::chrono::hours{1}});
}

}  // namespace rtpm::tool
