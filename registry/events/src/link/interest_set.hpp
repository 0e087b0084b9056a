#pragma once

#include <cstdint>
#include <vector>

#include "rtpm/events/filter.hpp"

/// Interest: the types and sources that subscriptions may accept, which a hub requests from
/// another hub.
namespace rtpm::events {

/// A superset of what `filter` accepts; ignores payload fields.
[[nodiscard]] std::vector<Match> interest_set_of(const Filter& filter);

/// Unites the interest of a hub's subscriptions for a link: one hop more, without entries beyond
/// kLinkHopsMax or covered by other entries. More than kMatchCountMax entries are widened to all
/// sources of a type, then to everything.
/// @source   spec/events.md#ev-5.2
[[nodiscard]] std::vector<Match> unite_interest(std::vector<Match> interest);

}  // namespace rtpm::events
