#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>

#include "rtpm/base/setup_error.hpp"

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
  kUnreachable,    ///< Not run: no server answers at the address. Check that it runs.
  kNoResources,    ///< This process has no descriptor or memory left for a connection (not run) or
                   ///< for a reply larger than a frame (run). Raise its limits (ulimit -n,
                   ///< ulimit -v), or close what it does not need.
  kRefused,        ///< Not run: the server refused the session (its limits or priority).
  kVersionUnsupported,  ///< Not run: no protocol version in common. Update the older side.
  kNoSuchMethod,        ///< Not run: the object lacks the method. Client and server schemas differ.
  kNoSuchObject,        ///< Not run: the object is not there (any more). Bind again.
  kBadRequest,          ///< Not run: the request is not what the method takes, or a value in it is
                        ///< outside its range. refusal_text() says which.
  kNotLeaseHolder,      ///< Not run: another client holds the lease. Acquire it first.
  kServantFailed,  ///< The servant ran and failed. refusal_text() and the server's log say why.
  kTooLarge,       ///< The request (not run), the reply, or an item of a stream (run) exceeds
                   ///< what caller and server both take.
  kWrongBand,      ///< Not run: in none of the object's bands, or outside the session's. Call at
                   ///< a priority of a band.
  kPriorityNotAllowed,  ///< Not run: above the ceiling granted to this session. Call at a lower
                        ///< one.
  kBadReply,            ///< It may have run; the reply is not what schema or protocol say. Schemas
                        ///< differ, or the server is of a later version.
  kCancelled,           ///< It was cancelled; it may have run.
  kStopped,             ///< The server is stopping; it may have run. Find another, or wait.
  kMaybeLost,  ///< Oneways only. Not sent: the connection or session ended with oneways in it that
               ///< may not have arrived. Binding::lost_oneway_count() says how many; it is told
               ///< once. The next oneway goes to the server that is there then.
  kWrongInterface,  ///< Not run: the object at the address, or that the name leads to by now, has
                    ///< another interface. Correct the name, or generate both sides anew.
  kStreamLost,  ///< The server ended the stream, as its reader was away for too long; it ran. Take
                ///< items oftener, or allow a longer pause (StreamOptions::pause_max), and open it
                ///< again.
  kNotAllowed,  ///< Not run: the server's grants do not let this caller do it. The server's log has
                ///< the line that would.
};

/// One sentence in words for a person: the cause and the remedy.
[[nodiscard]] std::string_view to_string(CallError error) noexcept;

/// The server's own words on why this thread's last call failed with kBadRequest or kServantFailed,
/// "force.x is 30, but must be -20 to 20 N"; empty if it gave none. Another program wrote
/// them: describe() has them ready to be shown.
/// @ownership valid until a call of this thread fails
/// @realtime alloc-free
[[nodiscard]] std::string_view refusal_text() noexcept;

/// to_string(error), with refusal_text() where it belongs to `error`, escaped as by printable().
/// Called by the thread whose call failed, before its next one.
/// @realtime set-up only
[[nodiscard]] std::string describe(CallError error);

/// A CallError as SetupError::cause, which compares with one.
[[nodiscard]] std::error_code make_error_code(CallError error) noexcept;

/// A servant's answer in place of a result.
enum class Refusal : std::uint8_t {
  kOverload,        ///< Not done: too much to do now.
  kBadRequest,      ///< Not done: a value in the request is outside what the method takes.
  kNotLeaseHolder,  ///< Not done: the caller does not hold the lease.
  kGone,            ///< Not done: what the method works on is no longer there.
  kNotAllowed,      ///< Not done: the caller's grants do not allow it.
  kFailed,          ///< Begun and failed.
};

/// The result of a servant's method, or its refusal.
template <class T>
using Result = expected<T, Refusal>;

}  // namespace rtpm::rpc

template <>
struct std::is_error_code_enum<rtpm::rpc::CallError> : std::true_type {};
