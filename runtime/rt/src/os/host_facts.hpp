#pragma once

#include "rtpm/rt/survey.hpp"

namespace rtpm::rt::os {

/// Fills in the answers about timers and the clock's synchronisation.
/// @realtime set-up only
void ask_clocks(HostAnswers& answers);
/// Fills in the answers about shared memory.
/// @realtime set-up only
void ask_shared_memory(HostAnswers& answers);

}  // namespace rtpm::rt::os
