#pragma once

#include <span>

#include "rtpm/base/role.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/events/filter.hpp"
#include "rtpm/rpc/caller.hpp"

/// The rights of a hub's callers to push and receive events. A hub that does not authenticate
/// callers passes null as the caller, which then has all rights.
///
/// An event has the path "rtpm/events/TYPE/SOURCE", both in decimal digits. A role on the hub,
/// "rtpm/events", or on "rtpm/events/TYPE" applies to all events below it.
namespace rtpm::events {

/// Whether the caller has `role` on all events.
/// @realtime like Caller::role_on(), once; the functions below, at most three times per event or
///           match
[[nodiscard]] bool may_use_all(const rpc::Caller* caller, Role role) noexcept;
/// Whether the caller has `role` on all events of a type.
[[nodiscard]] bool may_use_type(const rpc::Caller* caller, Role role, EventType type) noexcept;
/// Whether the caller may push each event of an encoded batch.
[[nodiscard]] bool may_push(const rpc::Caller* caller, ConstBytes events) noexcept;
/// Whether the caller may observe everything that a filter may accept.
[[nodiscard]] bool may_receive(const rpc::Caller* caller, std::span<const Match> interest) noexcept;

}  // namespace rtpm::events
