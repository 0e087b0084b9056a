#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace rtpm::wire {

/// Whether a client with one version of an interface can use a server with another, by the texts of
/// both. For a request, the client writes and the server reads; for a reply, the reverse. A field
/// that only the writer knows is ignored; one that only the reader knows must be optional.
/// @param client  this program's own text
/// @param server  any bytes; refused if they are not an interface text
/// @return nullopt if it can, or the difference, beginning with the method: "method `get` (id 4):
///         field 1 of table `lab.Reply` is `x: int32` there …"
/// @threads  any
/// @realtime set-up only: allocates an index of both texts
/// @source   spec/hprotocol.md#hp-12.2
[[nodiscard]] std::optional<std::string> find_obstacle(std::string_view client,
                                                       std::string_view server);

}  // namespace rtpm::wire
