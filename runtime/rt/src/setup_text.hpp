#pragma once

#include <string>

#include "rtpm/rt/budget.hpp"

namespace rtpm::rt {

/// The effect of the throttling limit, as a clause, with its remedy.
/// @realtime set-up only
[[nodiscard]] std::string throttling_text(RealtimeLimit limit);
[[nodiscard]] std::string throttling_remedy();

/// Whether the process, to which the system refused a real-time thread, is in a control group
/// without real-time runtime, so that its rights do not count.
/// @realtime set-up only
[[nodiscard]] bool is_group_without_realtime() noexcept;

}  // namespace rtpm::rt
