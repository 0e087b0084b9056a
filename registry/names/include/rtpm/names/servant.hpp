#pragma once

#include <functional>
#include <memory>
#include <string_view>

#include "rtpm/names/limits.hpp"
#include "rtpm/rpc/servant.hpp"

namespace rtpm::names {

/// Takes one sentence of a registry: that a name was taken from its holder, or that a limit refused
/// one. At most one of each kind a second, which says how many there were since the last. Called on
/// the lane.
using RegistryReport = std::function<void(std::string_view sentence)>;

/// The registry as an object, to be served under kRegistryPath: by rtpm-registryd or by any other
/// program that takes a registry in. `report` none: to standard error.
/// @threads  as a servant; lanes that meet wait for each other by a lock that passes priority on
/// @realtime not real-time. It allocates on its lane, so do not share the lane with what is
[[nodiscard]] std::unique_ptr<rpc::Servant> make_servant(Limits limits = {},
                                                         RegistryReport report = {});

}  // namespace rtpm::names
