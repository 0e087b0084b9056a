#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "rtpm/base/expected.hpp"

namespace rtpm::rpc {

/// Why a call gave no result. "Not run" errors promise that the servant did not run, so that a
/// caller may repeat even a call that must not run twice. (An idempotent method is called again by
/// itself when the connection breaks or the server restarts; the error is then that of the last
/// try.)
enum class CallError : std::uint8_t {
  kTimeout,        ///< No reply within the deadline; it may have run. Check the peer and the load.
  kExpired,        ///< Not run: the deadline passed before the servant began. Allow more time.
  kOverload,       ///< Not run: the server's lane is full. Call less often, or add a lane.
  kNoChannel,      ///< Not run: every call channel is in use. Raise NodeConfig::channel_count_max.
  kDisconnected,   ///< The connection broke; it may have run. The next call connects again.
  kPeerRestarted,  ///< The server restarted in mid-call; it may have run. The next call binds
                   ///< again.
  kUnreachable,    ///< Not run: nobody serves the address. Check that the server runs.
  kRefused,        ///< Not run: the server refused the session (its limits or priority).
  kVersionUnsupported,  ///< Not run: no protocol version in common. Update the older side.
  kNoSuchMethod,        ///< Not run: the object lacks the method. Client and server schemas differ.
  kNoSuchObject,        ///< Not run: the object is not there (any more). Bind again.
  kBadRequest,          ///< Not run: the server could not read the request. Schemas differ.
  kNotLeaseHolder,      ///< Not run: somebody else holds the lease. Acquire it first.
  kServantFailed,       ///< The servant ran and failed. The server's log says why.
  kTooLarge,            ///< The request (not run) or the reply (run) exceeds the session's limit.
  kPriorityNotAllowed,  ///< Not run: above the ceiling granted to this session. Call at a lower
                        ///< one.
  kBadReply,            ///< It may have run; the reply is not what schema or protocol say. Schemas
                        ///< differ, or the server is of a later version.
  kCancelled,           ///< It was cancelled; it may have run.
  kStopped,             ///< The server is stopping; it may have run. Find another, or wait.
};

/// One sentence in words for a person: the cause and the remedy.
[[nodiscard]] std::string_view to_string(CallError error) noexcept;

/// Why set-up failed: one sentence that names the thing, the cause and the remedy.
struct SetupError {
  std::string text;
};

[[nodiscard]] inline unexpected<SetupError> setup_error(std::string text) {
  return unexpected<SetupError>{SetupError{std::move(text)}};
}

/// What a servant may answer instead of a result.
enum class Refusal : std::uint8_t {
  kOverload,        ///< Not done: too much to do now.
  kBadRequest,      ///< Not done: a value in the request is outside what the method takes.
  kNotLeaseHolder,  ///< Not done: the caller does not hold the lease.
  kGone,            ///< Not done: what the method works on is no longer there.
  kFailed,          ///< Begun and failed.
};

/// What a servant's method returns.
template <class T>
using Result = expected<T, Refusal>;

}  // namespace rtpm::rpc
