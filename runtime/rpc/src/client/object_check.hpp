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

/// The outcome of asking a server for an object.
struct BindOutcome {
  CallOutcome::Kind kind = CallOutcome::Kind::kFailed;
  CallError error = CallError::kTimeout;
  Bound bound{};
  wire::Status status = wire::Status::kOk;
  std::string difference{};  ///< In the interface; empty if it is the same or compatible.
  std::array<char, 96> other_interface{};
  /// If the object is not there: the paths most like its own, as the server sent them.
  std::array<std::byte, wire::kSimilarPathCountMax*(wire::kPathSizeMax + 2)> similar_paths{};
  std::size_t similar_paths_size = 0;
};

/// Asks a server for an object, and compares the interfaces.
/// @param known  the server's fingerprint at the last bind, if any: an interface that was found to
///               be good once is good in another life of the server, too
/// @realtime alloc-free, unless the server has a version of the interface that is not known: then
///           it compares the two
[[nodiscard]] BindOutcome ask_for_object(const Destination& at,
                                         const InterfaceDescriptor& interface,
                                         std::optional<std::uint64_t> known, CallChannel& channel,
                                         Priority priority, MonotonicTime deadline) noexcept;

}  // namespace rtpm::rpc
