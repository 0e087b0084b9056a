#pragma once

#include <cstddef>
#include <string>

#include "figures/samples.hpp"
#include "rtpm/base/expected.hpp"
#include "sides/caller.hpp"

namespace rtpm::bench {

/// From when a paced call's latency counts.
enum class CountFrom {
  kDue,   ///< When it was due: the caller's own wake-up counts, and every delay's knock-on does.
  kSent,  ///< When it was sent, or was due if the call before it was not over by then.
};

/// Makes `count` calls, one every `period`, and adds their latencies to `samples`. The times at
/// which they are due are fixed at the begin, so a slow call cannot hide those that had to wait for
/// it. RT: alloc-free within the samples' room.
[[nodiscard]] expected<void, std::string> call_paced(Caller& caller, Duration period,
                                                     std::size_t count, CountFrom count_from,
                                                     Samples& samples);

}  // namespace rtpm::bench
