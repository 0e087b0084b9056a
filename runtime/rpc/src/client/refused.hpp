#pragma once

#include "rtpm/base/bytes.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/wire/status.hpp"

namespace rtpm::rpc {

/// The error for a refused call; keeps the server's text for this thread's refusal_text().
/// @realtime alloc-free
[[nodiscard]] CallError refused(wire::Status status, ConstBytes text) noexcept;

}  // namespace rtpm::rpc
