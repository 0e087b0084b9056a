#pragma once

#include <set>
#include <string>
#include <vector>

#include "channels/channel_table.hpp"
#include "foxglove/replies.hpp"
#include "live/object_watch.hpp"
#include "services/call_router.hpp"

namespace rtpm::console {

/// Who publishes and subscribes the channels, and who provides the services.
/// @param devices  names; the server of each publishes its channels
[[nodiscard]] foxglove::Graph connection_graph(const ChannelTable& channels,
                                               const CallRouter& router,
                                               const std::vector<ObjectView>& objects,
                                               const std::set<std::string>& devices);

}  // namespace rtpm::console
