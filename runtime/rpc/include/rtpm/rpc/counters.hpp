#pragma once

#include <cstdint>

#include "rtpm/wire/counters.hpp"

namespace rtpm::rpc {

/// A server's counts, summed over its lanes.
struct ServerCounters {
  /// Servant methods run. A lane that queues calls counts them when they are queued, so also those
  /// whose callers no longer wait when a thread is free.
  std::uint64_t call_count = 0;
  std::uint64_t servant_failure_count = 0;  ///< Methods that threw an exception.
  std::uint64_t bad_request_count = 0;      ///< Calls refused because they violate the schema.
  std::uint64_t connection_count = 0;       ///< Accepted over TCP or shared memory.
  std::uint64_t connection_lost_count = 0;  ///< Connections that ended, cleanly or not.
  /// Refused: all slots, or the host's share, were taken.
  std::uint64_t connection_refused_count = 0;
  /// Connections closed because of malformed shared memory.
  std::uint64_t broken_memory_count = 0;
  std::uint64_t send_failure_count = 0;  ///< Replies that the socket or ring did not accept.
  std::uint64_t deferred_count = 0;      ///< Calls that their methods answer later.
  std::uint64_t overload_count = 0;  ///< Calls refused because all threads and slots were taken.
  /// Calls not answered in time: the deadline passed before they arrived, while they waited or ran,
  /// or before their deferred reply was given.
  std::uint64_t late_count = 0;
  std::uint64_t borrowed_count = 0;    ///< Calls run by a thread of a lower lane.
  std::uint64_t queued_count_max = 0;  ///< The most calls that waited at a time in one lane.
  wire::FrameCounters frames{};        ///< Frames accepted and dropped, by reason.
};

}  // namespace rtpm::rpc
