#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/events/hub_types.hpp"

namespace rtpm::console {

/// Runs work on the web server's thread.
using Post = std::function<void(std::function<void()>)>;

/// The subscription that an event belongs to.
enum class EventStream : std::uint8_t {
  kSample,   ///< Samples of devices, decimated by the hub.
  kChange,   ///< Other reports of devices; all of them.
  kGeneric,  ///< Events of other types, decimated by the hub for each source separately.
  kLog,      ///< Events of a connection's log filter.
  kMark,     ///< Trials of experiments, at most 200 per second.
};

/// An event from the hub, with its own copy of the payload.
struct HubEvent {
  EventStream stream = EventStream::kChange;
  std::uint64_t connection_id = 0;  ///< The connection of a kLog filter.
  /// Events that the rate limit of kLog or kMark dropped just before this one.
  std::uint64_t omitted_count = 0;
  events::EventHeader header{};
  MonotonicTime arrived{};
  std::vector<std::byte> payload{};
};

/// Whether a watched program answers.
struct Standing {
  bool is_ok = false;
  std::string problem{"not asked yet"};
};

}  // namespace rtpm::console
