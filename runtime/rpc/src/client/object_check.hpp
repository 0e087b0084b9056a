#pragma once

#include <array>
#include <optional>
#include <string>

#include "client/call_channel.hpp"
#include "client/destinations.hpp"
#include "rtpm/rpc/interface.hpp"
#include "rtpm/wire/control.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::rpc {

/// The result of asking a server for an object.
struct BindOutcome {
  CallOutcome::Kind kind = CallOutcome::Kind::kFailed;
  CallError error = CallError::kTimeout;
  Bound bound{};
  wire::Status status = wire::Status::kOk;
  std::string difference{};  ///< The interface difference; empty if equal or compatible.
  std::array<char, 96> other_interface{};
  /// If the object does not exist: the most similar paths, as the server sent them.
  std::array<std::byte, wire::kSimilarPathCountMax*(wire::kPathSizeMax + 2)> similar_paths{};
  std::size_t similar_paths_size = 0;
};

/// Asks a server for an object, and compares the interfaces.
/// @param known  the server's fingerprint at the last bind, if any: an interface once found
///           compatible stays so after a server's restart
/// @realtime alloc-free, unless the server's version of the interface is unknown: then it compares
///           the two
[[nodiscard]] BindOutcome ask_for_object(const Destination& at,
                                         const InterfaceDescriptor& interface,
                                         std::optional<std::uint64_t> known, CallChannel& channel,
                                         Priority priority, MonotonicTime deadline) noexcept;

}  // namespace rtpm::rpc
