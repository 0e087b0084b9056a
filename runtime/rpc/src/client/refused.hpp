#pragma once

#include "rtpm/base/bytes.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/wire/status.hpp"

namespace rtpm::rpc {

/// The caller's error for a status other than ok.
/// @realtime alloc-free
[[nodiscard]] CallError error_of(wire::Status status) noexcept;

/// The error of the calling thread's call; keeps the server's words for refusal_text().
/// @realtime alloc-free
[[nodiscard]] CallError refused(wire::Status status, ConstBytes text) noexcept;

}  // namespace rtpm::rpc
