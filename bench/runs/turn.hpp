#pragma once

#include <cstdint>
#include <string>

#include "figures/samples.hpp"
#include "rtpm/base/expected.hpp"
#include "runs/paced_calls.hpp"
#include "sides/caller.hpp"
#include "sides/low_load.hpp"

namespace rtpm::bench {

/// What a contender does when it is its turn. Plain data, because a peer's program gets it through
/// shared memory.
struct TurnPlan {
  std::uint64_t warm_up_count = 0;  ///< Untimed calls: the first meet a server that was stopped.
  std::uint64_t count = 0;          ///< Timed calls.
  std::int64_t period_ns = 0;       ///< One call every so often; 0: one after the other.
  CountFrom count_from = CountFrom::kSent;
  std::int32_t low_caller_count = 0;  ///< Callers of low priority that load the server meanwhile.
};

/// Makes the calls of one turn and adds their latencies to `high`, and what the callers of low
/// priority met to `low`. It is the same code for RTPM, the floor and every peer.
/// `load`: null where the plan has no callers of low priority.
[[nodiscard]] expected<void, std::string> run_turn(const TurnPlan& plan, Caller& caller,
                                                   LowLoad* load, Samples& high, Samples& low);

}  // namespace rtpm::bench
