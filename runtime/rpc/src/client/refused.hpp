#pragma once

#include "rtpm/base/bytes.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/wire/status.hpp"

namespace rtpm::rpc {

/// The error that a status other than ok is to a caller.
/// @realtime alloc-free
[[nodiscard]] CallError error_of(wire::Status status) noexcept;

/// The same for the thread that is told of it, with the server's words for refusal_text().
/// @realtime alloc-free
[[nodiscard]] CallError refused(wire::Status status, ConstBytes text) noexcept;

}  // namespace rtpm::rpc
