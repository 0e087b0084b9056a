#pragma once

#include "verbs.hpp"

namespace rtpm::tool {

/// lanes: what the lanes of all servers on this host do, as far as their processes are the
/// caller's. lanes watch: again each second, until it is interrupted.
[[nodiscard]] int lanes(const Request& request);

/// doctor: what this host gives to real-time programs of the caller, with the remedies. 1 if
/// something is refused.
[[nodiscard]] int doctor(const Request& request);

}  // namespace rtpm::tool
