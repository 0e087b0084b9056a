#pragma once

#include <set>
#include <string>
#include <vector>

#include "channels/channel_table.hpp"
#include "foxglove/replies.hpp"
#include "live/object_watch.hpp"
#include "services/call_router.hpp"

namespace rtpm::console {

/// The publishers and subscribers of the channels, and the providers of the services.
/// @param devices  the devices' names; each device's server publishes the device's channels
[[nodiscard]] foxglove::Graph connection_graph(const ChannelTable& channels,
                                               const CallRouter& router,
                                               const std::vector<ObjectView>& objects,
                                               const std::set<std::string>& devices);

}  // namespace rtpm::console
