#pragma once

#include <functional>
#include <memory>
#include <string_view>

#include "rtpm/names/limits.hpp"
#include "rtpm/names/policy.hpp"
#include "rtpm/names/storage.hpp"
#include "rtpm/rpc/servant.hpp"

namespace rtpm::names {

/// Receives a sentence for each takeover and each refusal because of a limit, on the lane; at most
/// one of each kind per second, with the number of suppressed ones.
using RegistryReport = std::function<void(std::string_view sentence)>;

/// The parts of a registry.
struct RegistryConfig {
  Limits limits{};
  RegistryReport report{};  ///< If empty, writes to standard error.
  /// If null, names are in memory only. If several registries share the storage, changes wait for
  /// it on separate threads; reads do not wait.
  std::unique_ptr<Storage> storage{};
  /// If null, GrantPolicy is used.
  std::unique_ptr<const Policy> policy{};
};

/// Creates a servant like make_servant(), with the names of a storage. Reports what the storage
/// lost.
/// @errors   those of Storage::load()
[[nodiscard]] expected<std::unique_ptr<rpc::Servant>, SetupError> make_registry(
    RegistryConfig config);

/// The registry as an object, to be served at kRegistryPath. An empty `report` writes to standard
/// error.
/// @threads  any lane; under a priority-inheriting lock
/// @realtime none: it allocates, so do not share its lane with real-time objects
[[nodiscard]] std::unique_ptr<rpc::Servant> make_servant(Limits limits = {},
                                                         RegistryReport report = {});

}  // namespace rtpm::names
