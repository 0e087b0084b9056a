#include "live/state_json.hpp"

#include <utility>
#include <variant>

#include "rtpm/events/event.hpp"
#include "rtpm/gvd/device_event.hpp"

namespace rtpm::console {
namespace {

using Json = nlohmann::ordered_json;

/// The offset of the sequence in the payload, a bare struct of device_events.fbs or device.fbs.
constexpr std::size_t kSequenceOffset = 0;
constexpr std::size_t kLeaseStateOffset = 8;

}  // namespace

Json servers_json(const std::vector<ServerView>& servers) {
  Json list = Json::array();
  for (const ServerView& server : servers) {
    Json lanes = Json::array();
    for (const LaneView& lane : server.lanes) {
      lanes.push_back({{"name", lane.name},
                       {"band", {lane.band_low, lane.band_high}},
                       {"schedule", lane.schedule},
                       {"wait", lane.wait},
                       {"calls_per_s", lane.calls_per_s},
                       {"drops_per_s", lane.drops_per_s},
                       {"longest_cycle_us", lane.longest_cycle_us},
                       {"queued", lane.queued_count},
                       {"busy", lane.busy_count}});
    }
    list.push_back({{"name", server.name},
                    {"host", server.host},
                    {"port", server.port},
                    {"process_id", server.process_id},
                    {"alive", server.is_alive},
                    {"lanes", std::move(lanes)}});
  }
  return list;
}

Json latency_json(const std::string& name, const LatencySummary& summary) {
  Json histogram = Json::array();
  for (const LatencyBin& bin : summary.histogram)
    histogram.push_back({{"from_us", bin.from_us}, {"to_us", bin.to_us}, {"count", bin.count}});
  return {{"name", name},
          {"p50_us", summary.p50_us},
          {"p90_us", summary.p90_us},
          {"p99_us", summary.p99_us},
          {"p999_us", summary.p999_us},
          {"max_us", summary.max_us},
          {"count", summary.count},
          {"failed_count", summary.failed_count},
          {"histogram", std::move(histogram)}};
}

void take_device_event(const HubEvent& event, DeviceState& device, ParameterDesk& parameters) {
  const ConstBytes payload(event.payload);
  const auto arrived = event.arrived - (event.header.hub_sent - event.header.origin);
  if (event.header.type == gvd::kSampled && payload.size() >= kSequenceOffset + 8) {
    device.take_sample(load_le<std::uint64_t>(payload.data() + kSequenceOffset), event.arrived);
  } else if (event.header.type == gvd::kLeaseChanged && payload.size() > kLeaseStateOffset) {
    const auto state = std::to_integer<std::uint8_t>(payload[kLeaseStateOffset]);
    if (state < gvd::kLeaseStateCount) {
      device.take_lease(static_cast<gvd::LeaseState>(state), arrived);
    }
  } else if (event.header.type == gvd::kConfigurationChanged && !event.header.is_replayed) {
    parameters.on_change(device.name());
  }
}

}  // namespace rtpm::console
