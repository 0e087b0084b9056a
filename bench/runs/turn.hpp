#pragma once

#include <cstdint>
#include <string>

#include "figures/samples.hpp"
#include "rtpm/base/expected.hpp"
#include "sides/caller.hpp"
#include "sides/event_board.hpp"
#include "sides/event_sides.hpp"
#include "sides/low_load.hpp"

namespace rtpm::bench {

/// The moment from which a paced call's latency counts.
enum class CountFrom {
  kDue,   ///< When it was due: the caller's own wake-up counts, and every delay's knock-on does.
  kSent,  ///< When it was sent, or was due if the call before it was not over by then.
};

/// The plan of a contender's turn. Plain data, because a peer's program gets it through shared
/// memory.
struct TurnPlan {
  std::uint64_t warm_up_count = 0;  ///< Untimed calls: the first meet a server that was stopped.
  std::uint64_t count = 0;          ///< Timed calls.
  /// The period of the calls, which are due at fixed times, so that a slow call cannot hide those
  /// that had to wait for it. 0 if calls follow one another without pause.
  std::int64_t period_ns = 0;
  CountFrom count_from = CountFrom::kSent;
  std::int32_t low_caller_count = 0;  ///< Callers of low priority that load the server meanwhile.
};

/// Makes the calls of one turn and adds their latencies to `high`, and those of the callers of low
/// priority to `low`. The code is the same for RTPM, the floor and every peer.
/// @param load  null where the plan has no callers of low priority
[[nodiscard]] expected<void, std::string> run_turn(const TurnPlan& plan, Caller& caller,
                                                   LowLoad* load, Samples& high, Samples& low);

/// Events of one contender before the other's turn.
inline constexpr std::size_t kEventBlockSize = 50;

/// Pushes the events of one turn, as many as the board has cells for, and collects the records of
/// the first `consumer_count` consumers: each delivery, the last delivery of each event, and the
/// number of deliveries that did not come in time, which is added to `missing_count`.
/// @param block  a number that no turn before had
[[nodiscard]] expected<void, std::string> push_events(const TurnPlan& plan, EventSide& side,
                                                      EventBoard& board, std::uint32_t block,
                                                      int consumer_count, Samples& each,
                                                      Samples& last, std::uint64_t& missing_count);

}  // namespace rtpm::bench
