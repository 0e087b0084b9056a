#pragma once

#include <span>

#include "rtpm/base/role.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/events/filter.hpp"
#include "rtpm/rpc/caller.hpp"

/// Which events a caller of a hub may push and receive. A hub that asks nobody gives null for the
/// caller, who may do everything.
///
/// An event has the path "rtpm/events/TYPE/SOURCE", both in decimal digits. A role on the hub,
/// "rtpm/events", or on "rtpm/events/TYPE" is one on all events below.
namespace rtpm::events {

/// Whether the caller has `role` on all events.
/// @realtime as Caller::role_on(), once; the functions below thrice for each event or match at most
[[nodiscard]] bool may_use_all(const rpc::Caller* caller, Role role) noexcept;
/// On all events of a type.
[[nodiscard]] bool may_use_type(const rpc::Caller* caller, Role role, EventType type) noexcept;
/// On each event of an encoded batch.
[[nodiscard]] bool may_push(const rpc::Caller* caller, ConstBytes events) noexcept;
/// Whether the caller may observe everything that a filter may accept.
[[nodiscard]] bool may_receive(const rpc::Caller* caller, std::span<const Match> interest) noexcept;

}  // namespace rtpm::events
