#include "guard.hpp"

#include <array>
#include <cstdlib>
#include <string_view>

namespace rtpm::c {
namespace {

thread_local std::string last_error;

constexpr std::array<const char*, 13> kNames{
    "ok",   "invalid", "unreachable", "timeout", "refused", "failed",   "not holder",
    "held", "stopped", "not active",  "nothing", "ended",   "no memory"};

rtpm_status status_of(rpc::CallError error) noexcept {
  using rpc::CallError;
  switch (error) {
    case CallError::kTimeout:
      return RTPM_TIMEOUT;
    case CallError::kUnreachable:
    case CallError::kNoSuchObject:
      return RTPM_UNREACHABLE;
    case CallError::kBadRequest:
      return RTPM_INVALID;
    case CallError::kNotLeaseHolder:
      return RTPM_NOT_HOLDER;
    case CallError::kExpired:
    case CallError::kOverload:
    case CallError::kNoChannel:
    case CallError::kRefused:
    case CallError::kVersionUnsupported:
    case CallError::kNoSuchMethod:
    case CallError::kWrongBand:
    case CallError::kPriorityNotAllowed:
    case CallError::kWrongInterface:
    case CallError::kNotAllowed:
      return RTPM_REFUSED;
    default:
      return RTPM_FAILED;
  }
}

rtpm_status status_of(const gvd::DeviceError& error) noexcept {
  using gvd::DeviceOutcome;
  switch (error.outcome()) {
    case DeviceOutcome::kDone:
      return RTPM_OK;
    case DeviceOutcome::kNotHolder:
      return RTPM_NOT_HOLDER;
    case DeviceOutcome::kHeld:
      return RTPM_HELD;
    case DeviceOutcome::kNotActive:
      return RTPM_NOT_ACTIVE;
    case DeviceOutcome::kNotFinite:
    case DeviceOutcome::kOutOfRange:
      return RTPM_INVALID;
    case DeviceOutcome::kEmergencyStop:
      return RTPM_STOPPED;
    case DeviceOutcome::kNoSample:
      return RTPM_NOTHING;
    case DeviceOutcome::kCallFailed:
      return status_of(error.call());
    default:
      return RTPM_REFUSED;
  }
}

}  // namespace

void begin() noexcept {
  last_error.clear();
}

rtpm_status failed(rtpm_status status, std::string text) noexcept {
  last_error = std::move(text);
  return status;
}
rtpm_status failed(const SetupError& error, rtpm_status otherwise) noexcept {
  last_error = error.text();
  const bool is_call = error.cause.category() == rpc::make_error_code(rpc::CallError{}).category();
  return is_call ? status_of(static_cast<rpc::CallError>(error.cause.value() - 1)) : otherwise;
}
rtpm_status failed(const std::string& what, const gvd::DeviceError& error) noexcept {
  last_error = what + ": " + std::string(gvd::to_string(error));
  return status_of(error);
}
rtpm_status failed(const std::string& what, rpc::CallError error) noexcept {
  last_error = what + ": " + rpc::describe(error);
  return status_of(error);
}
rtpm_status invalid(std::string text) noexcept {
  return failed(RTPM_INVALID, std::move(text));
}

rtpm_status give_bytes(std::span<const std::byte> bytes, void** to) noexcept {
  auto* const copy = static_cast<std::byte*>(std::malloc(bytes.size() + 1));
  if (copy == nullptr) return failed(RTPM_NO_MEMORY, "there is no memory");
  std::ranges::copy(bytes, copy);
  copy[bytes.size()] = {};
  *to = copy;
  return RTPM_OK;
}
rtpm_status give_text(const std::string& text, char** to) noexcept {
  void* copy = nullptr;
  const rtpm_status status = give_bytes(std::as_bytes(std::span(text)), &copy);
  if (status == RTPM_OK) *to = static_cast<char*>(copy);
  return status;
}

}  // namespace rtpm::c

extern "C" {

uint32_t rtpm_version(void) {
  return RTPM_VERSION_MAJOR << 16 | RTPM_VERSION_MINOR << 8 | RTPM_VERSION_PATCH;
}
const char* rtpm_last_error(void) {
  return rtpm::c::last_error.c_str();
}
const char* rtpm_status_name(rtpm_status status) {
  const auto index = static_cast<std::size_t>(status);
  return index < rtpm::c::kNames.size() ? rtpm::c::kNames[index] : "unknown";
}
void rtpm_free(void* memory) {
  std::free(memory);
}

}  // extern "C"
