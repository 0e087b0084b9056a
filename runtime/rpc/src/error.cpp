#include "rtpm/rpc/error.hpp"

#include <string>

#include "rtpm/rpc/servant.hpp"
#include "rtpm/transport/address.hpp"

namespace rtpm::rpc {
namespace {

class CallErrorCategory final : public std::error_category {
  const char* name() const noexcept override { return "call"; }
  std::string message(int value) const override {
    return std::string(to_string(static_cast<CallError>(value - 1)));
  }
};

}  // namespace

std::error_code make_error_code(CallError error) noexcept {
  static const CallErrorCategory category;
  // From 1 on, because zero is success in a std::error_code.
  return {static_cast<int>(error) + 1, category};
}

std::string to_string(CallerHost host) {
  constexpr std::uint64_t kIpv4Max = 0xffff'ffff;
  if (host.number <= kIpv4Max) {
    return transport::SocketAddress::of_ipv4(static_cast<std::uint32_t>(host.number), 0).host();
  }
  return transport::SocketAddress::of(wire::PeerAddress{.high = host.number}).host() + "/64";
}

std::string_view to_string(CallError error) noexcept {
  switch (error) {
    case CallError::kTimeout:
      return "no reply came within the deadline; check that the server runs and is not overloaded";
    case CallError::kExpired:
      return "the deadline passed before the server could begin; allow more time";
    case CallError::kOverload:
      return "the server is overloaded; call less often or add a lane";
    case CallError::kNoChannel:
      return "every call channel is in use; raise NodeConfig::channel_count_max";
    case CallError::kDisconnected:
      return "the connection to the server broke; the next call connects again";
    case CallError::kPeerRestarted:
      return "the server restarted during the call; call again if a second run does no harm";
    case CallError::kUnreachable:
      return "no server answers at the address; check that the server runs";
    case CallError::kNoResources:
      return "this process has too many open files, or no memory left, for a connection or a large "
             "reply; raise its limits (ulimit -n, ulimit -v)";
    case CallError::kRefused:
      return "the server refused the session; check the limits and priority that it asked for";
    case CallError::kVersionUnsupported:
      return "client and server have no protocol version in common; update the older of the two";
    case CallError::kNoSuchMethod:
      return "the object has no such method; generate client and server from the same schema";
    case CallError::kNoSuchObject:
      return "the object is not there any more; bind again";
    case CallError::kBadRequest:
      return "the server could not accept the request; check its values, and that client and "
             "server share the schema";
    case CallError::kNotLeaseHolder:
      return "another client holds the lease; acquire it first";
    case CallError::kServantFailed:
      return "the servant failed; see what its program reports";
    case CallError::kTooLarge:
      return "a message, or an item of a stream, is too large; raise message_size_max on both "
             "sides";
    case CallError::kWrongBand:
      return "the priority is in none of the object's bands; call at one that is";
    case CallError::kPriorityNotAllowed:
      return "the priority is above the server's ceiling; call at a lower one";
    case CallError::kBadReply:
      return "the reply is not what the schema says; generate client and server from the same "
             "schema";
    case CallError::kCancelled:
      return "the call was cancelled";
    case CallError::kStreamLost:
      return "the server ended the stream, as its reader took no items for too long; take them "
             "oftener, or allow a longer pause";
    case CallError::kStopped:
      return "the server is stopping; find another, or call again later if a second run does no "
             "harm";
    case CallError::kMaybeLost:
      return "the connection ended, and oneways that were sent over it may not have arrived; this "
             "one was not sent, the next one connects again";
    case CallError::kWrongInterface:
      return "the object that is there now has another interface; generate client and server from "
             "the same schema, or correct the name";
    case CallError::kNotAllowed:
      return "the server's grants do not allow this to the caller; its log has the line of "
             "'authorized' that would";
  }
  return "unknown error";
}

}  // namespace rtpm::rpc
