#pragma once

#include <compare>
#include <cstdint>
#include <optional>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/deferred.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/interface.hpp"
#include "rtpm/wire/status.hpp"

namespace rtpm::rpc {

class Caller;

/// The host that a call came from: over UDP the address that the session's cookie confirmed, over
/// TCP the connection's. 127.0.0.1 otherwise, and for callers on the server's own address. The
/// addresses of an IPv6 /64 count as one host. Suitable for quotas, not for rights: several hosts
/// may share an address (NAT), and an attacker on the path can forge it.
struct CallerHost {
  /// An IPv4 address, 127.0.0.1 being 0x7f000001, or the first 64 bits of an IPv6 address; 0 if
  /// unknown, as in tests.
  std::uint64_t number = 0;
  [[nodiscard]] constexpr bool is_this_host() const noexcept { return number >> 24 == 127; }
  friend auto operator<=>(const CallerHost&, const CallerHost&) = default;
};
inline constexpr CallerHost kThisHost{0x7f00'0001};

/// "10.0.0.1", "2001:db8:0:1::/64".
/// @realtime set-up only
[[nodiscard]] std::string to_string(CallerHost host);

/// A servant's view of the call that it serves. Valid during the call only.
struct CallContext {
  Priority priority;             ///< The priority at which the method runs.
  MonotonicTime deadline;        ///< The time at which the caller stops waiting.
  MonotonicTime received;        ///< When the lane received the request.
  std::uint64_t session = 0;     ///< The caller's session: equal numbers mean the same caller.
  std::uint64_t trace_id = 0;    ///< Set by the caller, 0 if none.
  Deferral* deferral = nullptr;  ///< Lets a method answer later or with a stream; null in tests.
  CallerHost caller{};           ///< The host that the call came from.
  const Caller* identity = nullptr;  ///< Null if the server does not authenticate callers.
};

/// The result of a dispatch; generated code creates it.
struct DispatchResult {
  wire::Status status = wire::Status::kOk;
  std::uint32_t reply_size = 0;  ///< Bytes of the reply buffer in use, from its beginning.
};

/// An object that serves calls. Generated skeletons derive from it; servants derive from the
/// skeletons.
class Servant {
 public:
  Servant() = default;
  Servant(const Servant&) = delete;
  Servant& operator=(const Servant&) = delete;
  virtual ~Servant() = default;

  [[nodiscard]] virtual const InterfaceDescriptor& interface() const noexcept = 0;

  /// Runs the method `method_id` with `request` and writes its result to the beginning of `reply`.
  /// The return value is ignored if the method deferred its reply (CallContext::deferral).
  /// Generated code implements it. `request` and `reply` are aligned to 16 bytes, valid until it
  /// returns, and do not overlap.
  /// @threads  every lane that serves the object, so several concurrently
  /// @realtime like the method's implementation; an exception is counted and answered as
  ///           kServantFailed
  virtual DispatchResult dispatch(std::uint16_t method_id, ConstBytes request, MutableBytes reply,
                                  const CallContext& context) = 0;
};

/// The wire status for a servant's refusal.
[[nodiscard]] constexpr wire::Status to_status(Refusal refusal) noexcept {
  switch (refusal) {
    case Refusal::kOverload:
      return wire::Status::kOverload;
    case Refusal::kBadRequest:
      return wire::Status::kBadRequest;
    case Refusal::kNotLeaseHolder:
      return wire::Status::kNotLeaseHolder;
    case Refusal::kGone:
      return wire::Status::kGone;
    case Refusal::kNotAllowed:
      return wire::Status::kNotAllowed;
    case Refusal::kFailed:
      break;
  }
  return wire::Status::kServantFailed;
}

}  // namespace rtpm::rpc
