#pragma once

#include "verbs.hpp"

namespace rtpm::tool {

/// lanes: the state of all lanes on this host that the user may read. lanes watch: refreshed every
/// second until Ctrl-C.
[[nodiscard]] int lanes(const Request& request);

/// doctor: what this host grants to the user's real-time programs, with remedies; 1 if it refuses
/// something.
[[nodiscard]] int doctor(const Request& request);

}  // namespace rtpm::tool
