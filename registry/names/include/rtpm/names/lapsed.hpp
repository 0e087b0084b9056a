#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::names {

/// A name whose lease ended without an unbind: its server hangs or is dead.
struct LapsedName {
  std::string name{};
  std::string url{};  ///< The URL that it led to.
  std::string interface {};
  std::uint64_t revision = 0;  ///< Pass it to Directory::unbind() to dismiss the name.
  Duration lapsed_for{};
  bool is_of_other_host = false;  ///< See NameEntry::is_of_other_host.
  std::string service_url{};      ///< The registry that had it.
};

/// The lapsed names that registries know.
struct LapsedAnswer {
  std::vector<LapsedName> names{};
  /// The registries that answered, and the scope, if it is a list of registries of which one
  /// answered. A name that one of them had, and that is now neither bound nor lapsed, was unbound.
  std::vector<std::string> services{};
};

/// Asks every registry of a scope for its lapsed names, like ask_every_service(). A registry with
/// its own database stores them there; any other one knows those since its start.
/// @threads  any
/// @realtime set-up only; blocks at most until `deadline`
[[nodiscard]] LapsedAnswer ask_for_lapsed(rpc::Node& node, const std::string& where,
                                          MonotonicTime deadline);
/// Dismisses a lapsed name at its registry.
/// @errors   those of Directory::unbind(), also for a name that was bound again meanwhile
[[nodiscard]] expected<void, DirectoryError> dismiss(rpc::Node& node, const LapsedName& lapsed);

}  // namespace rtpm::names
