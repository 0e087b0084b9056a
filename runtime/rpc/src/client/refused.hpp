#pragma once

#include "rtpm/base/bytes.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/wire/status.hpp"

namespace rtpm::rpc {

/// The error of the calling thread's call; keeps the server's words for refusal_text().
/// @realtime alloc-free
[[nodiscard]] CallError refused(wire::Status status, ConstBytes text) noexcept;

}  // namespace rtpm::rpc
