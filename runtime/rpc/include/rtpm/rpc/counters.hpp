#pragma once

#include <cstdint>

#include "rtpm/wire/counters.hpp"

namespace rtpm::rpc {

/// What a server did, summed over its lanes.
struct ServerCounters {
  std::uint64_t call_count = 0;                ///< Servant methods run.
  std::uint64_t servant_failure_count = 0;     ///< Of these, ended by an exception.
  std::uint64_t bad_request_count = 0;         ///< Of these, refused: not what the schema says.
  std::uint64_t connection_count = 0;          ///< Accepted, over TCP or through shared memory.
  std::uint64_t connection_lost_count = 0;     ///< Of these, ended, in order or not.
  std::uint64_t connection_refused_count = 0;  ///< Not taken: all places, or their host's, are.
  std::uint64_t broken_memory_count = 0;       ///< Of these, because shared memory held nonsense.
  std::uint64_t send_failure_count = 0;        ///< Replies that the socket or ring did not take.
  std::uint64_t deferred_count = 0;            ///< Calls whose methods took a reply to give later.
  std::uint64_t overload_count = 0;  ///< Calls refused because all threads and places were taken.
  /// Calls that were not answered in time: it was over when they came, as they waited, while they
  /// ran, or before what they had deferred was given.
  std::uint64_t late_count = 0;
  std::uint64_t borrowed_count = 0;    ///< Calls run by a thread of a lower lane.
  std::uint64_t queued_count_max = 0;  ///< As many calls have waited at a time, in one lane.
  wire::FrameCounters frames{};        ///< Frames taken and dropped, by reason.
};

}  // namespace rtpm::rpc
