#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::rpc {

/// Why a call gave no result. "Not run" means that the servant did not run, so the caller may
/// safely repeat even a call that must not run twice. (The node repeats an idempotent call by
/// itself when the connection breaks or the server restarts; the error is then that of the last
/// try.)
enum class CallError : std::uint8_t {
  kTimeout,       ///< No reply within the deadline; it may have run. Check the peer and the load.
  kExpired,       ///< Not run: the deadline passed before the servant began. Allow more time.
  kOverload,      ///< Not run: the server's lane is full. Call less often, or add a lane.
  kNoChannel,     ///< Not run: every call channel is in use. Raise NodeConfig::channel_count_max.
  kDisconnected,  ///< The connection was lost; it may have run. The next call connects again.
  /// The server restarted during the call; it may have run. The next call binds again.
  kPeerRestarted,
  kUnreachable,  ///< Not run: no server answers at the address. Check that it runs.
  kNoResources,  ///< This process has no descriptor or memory left for a connection (not run) or
                 ///< for a reply larger than a frame (run). Raise its limits (ulimit -n,
                 ///< ulimit -v), or close what it does not need.
  kRefused,      ///< Not run: the server refused the session (its limits or priority).
  kVersionUnsupported,  ///< Not run: no common protocol version. Update the older side.
  kNoSuchMethod,        ///< Not run: the object lacks the method. Client and server schemas differ.
  kNoSuchObject,        ///< Not run: the object does not exist (any more). Bind again.
  /// Not run: the request does not match the method, or a value in it is out of range.
  /// refusal_text() says which.
  kBadRequest,
  kNotLeaseHolder,  ///< Not run: another client holds the lease. Acquire it first.
  kServantFailed,   ///< The servant ran and failed. refusal_text() and the server's log say why.
  /// The request (not run), the reply, or an item of a stream (run) exceeds the limit of caller or
  /// server.
  kTooLarge,
  /// Not run: the priority is in none of the object's bands, or outside the session's. Call at a
  /// priority within a band.
  kWrongBand,
  kPriorityNotAllowed,  ///< Not run: above the ceiling granted to this session. Call at a lower
                        ///< one.
  /// It may have run; the reply does not match the schema or the protocol. The schemas differ, or
  /// the server is of a later version.
  kBadReply,
  kCancelled,  ///< It was cancelled; it may have run.
  kStopped,    ///< The server is stopping; it may have run. Find another, or wait.
  /// Oneways only. Not sent: the connection or session ended, and earlier oneways may not have
  /// arrived. Binding::lost_oneway_count() counts them. Reported once; the next oneway goes to the
  /// current server.
  kMaybeLost,
  /// Not run: the object at the address, or the one that the name now leads to, has another
  /// interface. Correct the name, or generate both sides anew.
  kWrongInterface,
  /// The server ended the stream because the reader paused for too long; it ran. Read items more
  /// often, or allow a longer pause (StreamOptions::pause_max), and open it again.
  kStreamLost,
  /// Not run: the server's grants do not allow this caller the call. The server's log shows the
  /// line that would allow it.
  kNotAllowed,
};

/// The error's cause and remedy in one sentence.
[[nodiscard]] std::string_view to_string(CallError error) noexcept;

/// The server's explanation why this thread's last call failed with kBadRequest or kServantFailed,
/// such as "force.x is 30, but must be -20 to 20 N"; empty if it gave none. The text is untrusted:
/// to show it, use describe().
/// @ownership valid until the next failed call of this thread
/// @realtime alloc-free
[[nodiscard]] std::string_view refusal_text() noexcept;

/// to_string(error) and, if it belongs to `error`, refusal_text(), escaped as by printable(). Call
/// it on the thread whose call failed, before that thread's next call.
/// @realtime set-up only
[[nodiscard]] std::string describe(CallError error);

/// The error as a std::error_code. A SetupError::cause can be compared with a CallError.
[[nodiscard]] std::error_code make_error_code(CallError error) noexcept;

/// A servant's answer in place of a result.
enum class Refusal : std::uint8_t {
  kOverload,        ///< Not done: too busy now.
  kBadRequest,      ///< Not done: a value in the request is out of the method's range.
  kNotLeaseHolder,  ///< Not done: the caller does not hold the lease.
  kGone,            ///< Not done: the target of the method no longer exists.
  kNotAllowed,      ///< Not done: the caller's grants do not allow it.
  kFailed,          ///< Started and failed.
};

/// The result of a servant's method, or its refusal.
template <class T>
using Result = expected<T, Refusal>;

}  // namespace rtpm::rpc

template <>
struct std::is_error_code_enum<rtpm::rpc::CallError> : std::true_type {};
