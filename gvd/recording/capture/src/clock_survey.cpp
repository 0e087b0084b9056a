#include "rtpm/capture/clock_survey.hpp"

#include <algorithm>
#include <cstdio>
#include <device.rtpm.hpp>
#include <utility>

#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::capture {

struct ClockSurvey::Peer {
  std::string url;
  std::unique_ptr<dynamic::RemoteObject> object{};
};

ClockSurvey::ClockSurvey(rpc::Node& node, Duration deadline) : node_(node), deadline_(deadline) {}
ClockSurvey::ClockSurvey(ClockSurvey&&) noexcept = default;
ClockSurvey::~ClockSurvey() = default;

void ClockSurvey::add(std::string_view name, const std::string& url) {
  const auto parts = wire::parse_url(url);
  const std::string server = parts ? "rtpm://" + parts->authority() : url;
  auto found = std::ranges::find(clocks_, server, &ServerClock::server);
  if (found == clocks_.end()) {
    found = clocks_.insert(clocks_.end(), ServerClock{.server = server});
    peers_.push_back(std::make_unique<Peer>(Peer{.url = url}));
  }
  if (std::ranges::find(found->names, name) == found->names.end()) found->names.emplace_back(name);
}

expected<void, SetupError> ClockSurvey::add_devices(const std::string& registry) {
  const auto entries = names::Directory(node_, registry).list();
  if (!entries) return unexpected{SetupError{entries.error()}};
  for (const names::NameEntry& entry : *entries) {
    if (entry.interface == device::DeviceClient::interface().name) add(entry.name, entry.url);
  }
  return {};
}

void ClockSurvey::measure(std::uint32_t count) {
  for (std::size_t i = 0; i < clocks_.size(); ++i) {
    ServerClock& one = clocks_[i];
    Peer& peer = *peers_[i];
    one.problem.clear();
    if (!peer.object) {
      auto opened = dynamic::RemoteObject::open(node_, peer.url);
      if (!opened) {
        one.problem = opened.error().text();
        continue;
      }
      peer.object = std::move(*opened);
    }
    for (std::uint32_t n = 0; n < count && one.problem.empty(); ++n) {
      const MonotonicTime begin = rt::now();
      const auto clock = peer.object->binding().ping({.deadline = deadline_});
      if (!clock) {
        one.problem = to_string(clock.error());
      } else {
        one.trip = std::min(one.trip, rt::now() - begin);
        if (clock->uncertainty != Duration::max()) one.clock = *clock;
      }
    }
  }
}

std::span<const ServerClock> ClockSurvey::clocks() const noexcept {
  return clocks_;
}

recording::Metadata clock_metadata(const ClockSurvey& survey, const recording::Recorder& recorder,
                                   std::string_view when) {
  recording::Metadata metadata{.name = "rtpm.clocks"};
  const MonotonicTime now = rt::now();
  metadata.values = {
      {"measured", std::string(when)},
      {"log_time_minus_monotonic_ns",
       std::to_string(static_cast<std::int64_t>(recorder.log_time_ns(now)) - to_ns(now))}};
  for (const ServerClock& one : survey.clocks()) {
    for (const std::string& name : one.names) {
      metadata.values[name + "/server"] = one.server;
      if (!one.clock) {
        metadata.values[name + "/uncertainty_ns"] = "unknown: " + one.problem;
        continue;
      }
      char drift[32];
      std::snprintf(drift, sizeof drift, "%.3f", one.clock->drift_ppm);
      metadata.values[name + "/offset_ns"] = std::to_string(one.clock->offset.count());
      metadata.values[name + "/uncertainty_ns"] = std::to_string(one.clock->uncertainty.count());
      metadata.values[name + "/drift_ppm"] = drift;
    }
  }
  return metadata;
}

}  // namespace rtpm::capture
