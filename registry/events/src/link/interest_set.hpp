#pragma once

#include <cstdint>
#include <vector>

#include "rtpm/events/filter.hpp"

/// What a hub asks another for: the types and sources that its subscriptions may accept.
namespace rtpm::events {

/// A wide guess at what `filter` accepts: no event beyond these meets it. Fields are not looked at.
[[nodiscard]] std::vector<Match> interest_set_of(const Filter& filter);

/// `interest` of this hub's subscriptions as those of a link: each one hop further, none that is
/// beyond kLinkHopsMax or that another covers. Of more than kMatchCountMax those of single sources
/// are widened to all of their type, then to everything.
/// @source   spec/events.md#ev-5.2
[[nodiscard]] std::vector<Match> unite_interest(std::vector<Match> interest);

}  // namespace rtpm::events
