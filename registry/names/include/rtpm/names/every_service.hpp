#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/lapsed.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::names {

/// The answer of one name service.
struct ServiceAnswer {
  /// URL of the service; empty for a sentence about services that were left out, which is in
  /// `error`.
  std::string url{};
  std::vector<NameEntry> names{};    ///< Bound names; after an error, those received before it.
  std::vector<LapsedName> lapsed{};  ///< Names whose servers are lost, if the service keeps them.
  /// Why it did not answer, or not completely.
  std::optional<DirectoryError> error{};
};

/// Asks every name service of a scope for all its names, concurrently and independently: for
/// callers that must act on every binding of a name, such as an emergency stop. Unlike in a
/// Directory, a name that is bound twice is not an error, a service that hangs delays no other
/// service, and the registry at this host's default address is asked even if the user has their own
/// registry, unless RTPM_RUNTIME_FOLDER is set.
/// @param where     as for Directory
/// @param deadline  the time by which it returns, earlier if all have answered; later answers are
///                  lost
/// @param take      called for each service, concurrently from several threads, then for each
///                  sentence about services that were left out
/// @threads  any
/// @realtime set-up only; blocks
/// @errors   of the scope: its text is malformed, no such interface, this host's folder is unsafe;
///           every service that could be asked was asked anyway
[[nodiscard]] expected<void, SetupError> ask_every_service(
    rpc::Node& node, const std::string& where, MonotonicTime deadline,
    const std::function<void(ServiceAnswer)>& take);

}  // namespace rtpm::names
