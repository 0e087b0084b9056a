#pragma once

#include <cstdint>
#include <vector>

#include "rtpm/events/filter.hpp"

/// Interest: the types and sources that subscriptions may accept, and that a hub requests from
/// another hub.
namespace rtpm::events {

/// A superset of the events that `filter` accepts; ignores payload fields.
[[nodiscard]] std::vector<Match> interest_set_of(const Filter& filter);

/// Merges the interests of a hub's subscriptions for a link: adds a hop, and drops entries beyond
/// kLinkHopsMax or covered by others. If more than kMatchCountMax entries remain, widens them to
/// all sources of a type, then to everything.
/// @source   spec/events.md#ev-5.2
[[nodiscard]] std::vector<Match> unite_interest(std::vector<Match> interest);

}  // namespace rtpm::events
