#pragma once

#include <cstdint>
#include <functional>

#include "figures/samples.hpp"
#include "outcome.hpp"
#include "sides/caller.hpp"
#include "sides/event_board.hpp"
#include "sides/low_load.hpp"

namespace rtpm::bench {

/// The moment from which a paced call's latency counts.
enum class CountFrom {
  kDue,   ///< When it was due: the caller's own wake-up counts, and every delay's knock-on does.
  kSent,  ///< When it was sent, or was due if the call before it was not over by then.
};

/// The plan of a contender's turn.
struct TurnPlan {
  std::uint64_t warm_up_count = 0;  ///< Untimed calls: the first meet a server that was stopped.
  std::uint64_t count = 0;          ///< Timed calls.
  /// The period of the calls, which are due at fixed times, so that a slow call cannot hide those
  /// that had to wait for it. 0 if calls follow one another without pause.
  std::int64_t period_ns = 0;
  CountFrom count_from = CountFrom::kSent;
  std::int32_t low_caller_count = 0;  ///< Callers of low priority that load the server meanwhile.
};

/// A contender's measurements. For calls: those measured and those of the load beside them. For
/// events: each delivery, and the last delivery of each event.
struct Finding {
  Samples first;
  Samples second;
  std::uint64_t missing_count = 0;  ///< Deliveries that did not come in time.
};

/// One of the contenders that are measured by turns: RTPM, the raw floor, or a peer. Lets its server
/// run, makes the turn's calls, and stops the server again.
using Contender = std::function<Outcome<>(const TurnPlan& plan, Finding& finding)>;

/// Makes the calls of one turn. The code is the same for RTPM, the floor and every peer.
/// @param load  null where the plan has no callers of low priority
[[nodiscard]] Outcome<> run_turn(const TurnPlan& plan, const Call& caller, LowLoad* load,
                                 Finding& finding);

/// Events of one contender before the other's turn.
inline constexpr std::size_t kEventBlockSize = 50;

/// Pushes the events of one turn, as many as the board has cells for, and collects the records of
/// the first `consumer_count` consumers.
/// @param block  a number that no turn before had
[[nodiscard]] Outcome<> push_events(const TurnPlan& plan, EventSide& side, EventBoard& board,
                                    std::uint32_t block, int consumer_count, Finding& finding);

}  // namespace rtpm::bench
