#include "operators/stop_desk.hpp"

#include <utility>

#include "rtpm/rt/clock.hpp"

namespace rtpm::console {
namespace {

using Json = nlohmann::ordered_json;

/// A name counts as stopped when all servers with that name are stopped.
Json reply_of(const gvd::StopReport& report) {
  std::set<std::string> stopped;
  Json failed = Json::array();
  for (const gvd::StopResult& result : report.devices)
    stopped.insert(result.target.device);
  for (const gvd::StopResult& result : report.devices) {
    if (result.is_stopped) continue;
    stopped.erase(result.target.device);
    failed.push_back(
        {{"device", result.target.device}, {"url", result.target.url}, {"why", result.why}});
  }
  Json notes = report.notes;
  if (report.devices.empty() && report.told_hub_count == 0 && report.notes.empty()) {
    notes.push_back("no device is known");
  }
  return {{"stopped", stopped},
          {"failed", std::move(failed)},
          {"hub_count", report.told_hub_count},
          {"notes", std::move(notes)}};
}

}  // namespace

StopDesk::StopDesk(rpc::Node& node, gvd::StopDeliveryConfig config, CallRouter& router,
                   WorkerPool& urgent, Post post)
    : router_(router),
      urgent_(urgent),
      post_(std::move(post)),
      delivery_(node, std::move(config)) {}

void StopDesk::start() {
  router_.add_json("console/estop", [this](const PendingCall& call, const nlohmann::json& request) {
    stop(call, request);
  });
}

void StopDesk::remember(const std::string& device, const std::string& url) {
  delivery_.remember({device, url});
}

void StopDesk::dismiss(const std::string& device) {
  delivery_.dismiss(device);
}

void StopDesk::deliver() {
  static_cast<void>(delivery_.retry());
}

std::set<std::string> StopDesk::owed_devices() const {
  std::set<std::string> devices;
  for (const gvd::StopResult& result : delivery_.owed())
    devices.insert(result.target.device);
  return devices;
}

Json StopDesk::owed_json(MonotonicTime now) const {
  Json list = Json::array();
  for (const gvd::StopResult& result : delivery_.owed()) {
    list.push_back({{"device", result.target.device},
                    {"url", result.target.url},
                    {"why", result.why},
                    {"since_s", std::chrono::duration<double>(now - result.asked).count()}});
  }
  return list;
}

void StopDesk::stop(const PendingCall& call, const nlohmann::json& request) {
  std::string device;
  if (const auto found = request.find("device"); found != request.end()) {
    if (!found->is_string() || found->get<std::string>().empty()) {
      return router_.fail(call, "`device` is no name; leave it out to stop all");
    }
    device = found->get<std::string>();
  }
  const bool is_queued = urgent_.run(device, [this, call, device] {
    const gvd::StopReport report = delivery_.stop(device);
    post_([this, call, reply = reply_of(report)] { router_.succeed(call, reply); });
  });
  if (!is_queued) router_.fail(call, "too many stops are under way");
}

}  // namespace rtpm::console
