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

/// Runs work on the thread of the web server.
using Post = std::function<void(std::function<void()>)>;

/// For whom an event came.
enum class EventStream : std::uint8_t {
  kSample,   ///< A device's samples, decimated by the hub.
  kChange,   ///< What devices report besides; every one.
  kGeneric,  ///< Of other types, decimated by the hub, each source for itself.
  kLog,      ///< Of a connection's log filter.
};

/// An event of the hub with its own copy of the payload.
struct HubEvent {
  EventStream stream = EventStream::kChange;
  std::uint64_t connection_id = 0;  ///< Of kLog.
  std::uint64_t omitted_count = 0;  ///< Of kLog: left out just before, by the rate limit.
  events::EventHeader header{};
  MonotonicTime arrived{};
  std::vector<std::byte> payload{};
};

/// Whether something that the console watches answers.
struct Standing {
  bool is_ok = false;
  std::string problem{"not asked yet"};
};

}  // namespace rtpm::console
