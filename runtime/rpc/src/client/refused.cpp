#include "client/refused.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>

#include "rtpm/base/printable.hpp"
#include "rtpm/rpc/completions.hpp"

namespace rtpm::rpc {
namespace {

/// The text of this thread's last refused call.
thread_local std::array<char, wire::kRefusalTextSizeMax> refusal;
thread_local std::size_t refusal_size = 0;

CallError error_of(wire::Status status) noexcept {
  switch (status) {
    case wire::Status::kOverload:
      return CallError::kOverload;
    case wire::Status::kExpired:
      return CallError::kExpired;
    case wire::Status::kNoSuchMethod:
      return CallError::kNoSuchMethod;
    case wire::Status::kNoSuchObject:
    case wire::Status::kGone:
      return CallError::kNoSuchObject;
    case wire::Status::kBadRequest:
      return CallError::kBadRequest;
    case wire::Status::kNotLeaseHolder:
      return CallError::kNotLeaseHolder;
    case wire::Status::kServantFailed:
      return CallError::kServantFailed;
    case wire::Status::kTooLarge:
      return CallError::kTooLarge;
    case wire::Status::kWrongBand:
      return CallError::kWrongBand;
    case wire::Status::kPriorityNotAllowed:
      return CallError::kPriorityNotAllowed;
    case wire::Status::kCancelled:
      return CallError::kCancelled;
    case wire::Status::kStopping:
      return CallError::kStopped;
    case wire::Status::kWrongInterface:
      return CallError::kWrongInterface;
    case wire::Status::kLost:
      return CallError::kStreamLost;
    case wire::Status::kNotAllowed:
      return CallError::kNotAllowed;
    default:
      break;
  }
  // hp-5.1-7: statuses of later versions are unknown; do not claim that the call did not run.
  return static_cast<std::uint16_t>(status) < wire::kStatusCount ? CallError::kRefused
                                                                 : CallError::kBadReply;
}

}  // namespace

void set_refusal_text(std::string_view text) noexcept {
  refusal_size = std::min(text.size(), refusal.size());
  // The text may be this thread's own.
  if (refusal_size > 0) std::memmove(refusal.data(), text.data(), refusal_size);
}

CallError refused(wire::Status status, ConstBytes text) noexcept {
  set_refusal_text({reinterpret_cast<const char*>(text.data()), text.size()});
  return error_of(status);
}

std::string_view refusal_text() noexcept {
  return {refusal.data(), refusal_size};
}

std::string describe(CallError error) {
  const bool has_text = error == CallError::kBadRequest || error == CallError::kServantFailed;
  if (!has_text || refusal_text().empty()) return std::string(to_string(error));
  const std::string_view lead = error == CallError::kBadRequest
                                    ? "the server does not take the request: "
                                    : "the servant failed: ";
  return std::string(lead) + printable(refusal_text());
}

}  // namespace rtpm::rpc
