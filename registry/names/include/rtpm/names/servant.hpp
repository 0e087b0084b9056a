#pragma once

#include <memory>

#include "rtpm/names/store.hpp"
#include "rtpm/rpc/servant.hpp"

namespace rtpm::names {

/// The registry as an object, to be served under kRegistryPath: by rtpm-registryd or by any other
/// program that takes a registry in.
/// Threads: as a servant; lanes that meet wait for each other by a lock that passes priority on.
/// RT: not real-time. It allocates on its lane, so do not share the lane with what is.
[[nodiscard]] std::unique_ptr<rpc::Servant> make_servant(Limits limits = {});

}  // namespace rtpm::names
