#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace rtpm::wire {

/// The outcome that a REPLY or REFUSE frame carries. The numbers are the wire's and never change.
/// @source   spec/hprotocol.md#hp-7
enum class Status : std::uint16_t {
  kOk = 0,                   ///< The servant ran and its result is the payload.
  kOverload = 1,             ///< Not run: a queue or table is full. Send less, or later.
  kExpired = 2,              ///< Not run: the caller's deadline passed before the servant started.
  kNoSuchMethod = 3,         ///< Not run: the object has no method with that id.
  kNoSuchObject = 4,         ///< Not run: no object has that path or number.
  kBadRequest = 5,           ///< Not run: the payload is not valid for the method.
  kNotLeaseHolder = 6,       ///< Not run: another client holds the lease that the method needs.
  kGone = 7,                 ///< Not run: the object was removed from its server.
  kServantFailed = 8,        ///< The servant ran and failed.
  kTooLarge = 9,             ///< A message or item exceeds the session's limit. On a reply: it ran.
  kPriorityNotAllowed = 10,  ///< Not run: the priority is above the session's ceiling.
  kWrongBand = 11,       ///< Not run: the priority is outside the session's or the object's bands.
  kUnknownSession = 12,  ///< The server has no such session (any more): open a new one.
  kVersionUnsupported = 13,  ///< Handshake refused: no common protocol version.
  kBadLimits = 14,           ///< Handshake refused: a limit in it is out of range.
  kWrongInterface = 15,      ///< Bind refused: the object has another interface.
  kCancelled = 16,           ///< Ended early because its caller gave up.
  kStopping = 17,            ///< The server is stopping. A call that ran may have had an effect.
  kLost = 18,  ///< The stream ended because its client was silent for too long. It may have run.
  kNotAllowed = 19,  ///< Not run: the caller's identity may not do this.
};
inline constexpr std::uint16_t kStatusCount = 20;

/// When a call counts as done for its caller.
enum class Delivery : std::uint8_t {
  kReply,    ///< When the method's result has arrived.
  kReceipt,  ///< When the server is about to run it. The method's result is dropped.
  kSent,     ///< When it is sent; it may get lost. A single frame only.
};

/// The most bytes of text with which a server refuses a call.
/// @source   spec/hprotocol.md#hp-7-1
inline constexpr std::size_t kRefusalTextSizeMax = 200;

/// The name in the specification; "unknown" for an undefined number.
[[nodiscard]] std::string_view to_string(Status status) noexcept;

}  // namespace rtpm::wire
