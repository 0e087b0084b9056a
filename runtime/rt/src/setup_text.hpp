#pragma once

#include <string>

#include "rtpm/rt/budget.hpp"

namespace rtpm::rt {

/// The effect of the throttling limit, as a clause, with its remedy.
/// @realtime set-up only
[[nodiscard]] std::string throttling_text(RealtimeLimit limit);
[[nodiscard]] std::string throttling_remedy();

/// Whether the process is in a control group without real-time runtime, so that the system refuses
/// real-time threads whatever the user's rights.
/// @realtime set-up only
[[nodiscard]] bool is_group_without_realtime() noexcept;

}  // namespace rtpm::rt
