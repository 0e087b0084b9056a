#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "live/callbacks.hpp"
#include "live/device_state.hpp"
#include "live/lane_watch.hpp"
#include "live/latency_window.hpp"
#include "parameters/parameter_desk.hpp"

namespace rtpm::console {

/// Parts of the channels console/state and console/latency.
[[nodiscard]] nlohmann::ordered_json servers_json(const std::vector<ServerView>& servers);
[[nodiscard]] nlohmann::ordered_json latency_json(const std::string& name,
                                                  const LatencySummary& summary);

/// Applies a device's event to its state.
void take_device_event(const HubEvent& event, DeviceState& device, ParameterDesk& parameters);

}  // namespace rtpm::console
