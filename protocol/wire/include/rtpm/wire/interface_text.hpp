#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace rtpm::wire {

/// Whether a client of one version of an interface can use a server of another, by the texts of
/// both (spec/hprotocol.md#hp-12.2): nothing if it can, else what differs, in words that begin
/// with the method: "method `get` (id 4): field 1 of table `lab.Reply` is `x: int32` there …".
/// `client` is this program's own; `server` may be any bytes, and is refused if it is no such text.
/// In a request the client writes and the server reads, in a reply it is the other way round; what
/// only the writer knows is passed over, what only the reader knows must be absent without harm.
/// Threads: any.   Set-up only: allocates an index of both texts.
[[nodiscard]] std::optional<std::string> find_obstacle(std::string_view client,
                                                       std::string_view server);

}  // namespace rtpm::wire
