#pragma once

#include "figures/report.hpp"
#include "settings.hpp"

/// The cases with peers: RTPM, the raw floor and every peer take turns in one run.
namespace rtpm::bench {

/// Says on standard error which of the peers asked for are not built, with their packages; false if
/// one of them was asked for by its name.
bool say_missing_peers(const Settings& settings);

/// Each as the case of its name, with the peers that `settings` asks for. A peer that is not built,
/// or fails, is left out with a sentence on standard error; false if one was that was asked for by
/// its name, or if something else could not be measured.
bool run_call_with_peers(const Settings& settings, Report& report);
bool run_paced_with_peers(const Settings& settings, Report& report);
bool run_isolation_with_peers(const Settings& settings, Report& report);
bool run_events_with_peers(const Settings& settings, Report& report);

}  // namespace rtpm::bench
