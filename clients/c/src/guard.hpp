#pragma once

#include <algorithm>
#include <chrono>
#include <cstring>
#include <exception>
#include <new>
#include <span>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/gvd/error.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rtpm.h"

/// The border between C and C++: statuses, texts and sizes.
namespace rtpm::c {

/// Keeps the text for rtpm_last_error(), and returns the status.
rtpm_status failed(rtpm_status status, std::string text) noexcept;
/// The status is RTPM_UNREACHABLE if no server or name was there, else `otherwise`.
rtpm_status failed(const SetupError& error, rtpm_status otherwise) noexcept;
rtpm_status failed(const std::string& what, const gvd::DeviceError& error) noexcept;
rtpm_status failed(const std::string& what, rpc::CallError error) noexcept;
rtpm_status invalid(std::string text) noexcept;
/// Forgets the last error.
void begin() noexcept;

/// Runs the body of a function of the interface, from which no exception comes out.
template <class Body>
rtpm_status guarded(const Body& body) noexcept {
  begin();
  try {
    return body();
  } catch (const std::bad_alloc&) {
    return failed(RTPM_NO_MEMORY, "there is no memory");
  } catch (const std::exception& e) {
    return failed(RTPM_FAILED, e.what());
  }
}

/// Whether a struct of the program states its size. Its header may be older or newer than this one.
template <class Struct>
[[nodiscard]] bool has_size(const Struct* given) noexcept {
  return given != nullptr && given->struct_size >= sizeof(std::uint32_t) * 2;
}
/// The options given, and the defaults for fields that the program's header does not have.
template <class Options>
[[nodiscard]] Options options_of(const Options* given, Options otherwise) noexcept {
  if (given == nullptr) return otherwise;
  std::memcpy(&otherwise, given, std::min<std::size_t>(given->struct_size, sizeof(Options)));
  return otherwise;
}
/// Writes as much as the program's header has.
template <class Struct>
void give(Struct* to, Struct value) noexcept {
  const std::uint32_t size = to->struct_size;
  value.struct_size = size;
  std::memcpy(to, &value, std::min<std::size_t>(size, sizeof(Struct)));
}

/// Gives a copy, and a zero behind it, which rtpm_free() frees. RTPM_NO_MEMORY.
rtpm_status give_bytes(std::span<const std::byte> bytes, void** to) noexcept;
rtpm_status give_text(const std::string& text, char** to) noexcept;

/// At most 24 h, as longer spans would overflow in sums.
[[nodiscard]] inline Duration span_of_us(std::int64_t us) noexcept {
  constexpr std::int64_t kMax = std::int64_t{24} * 3600 * 1'000'000;
  return std::chrono::microseconds{std::clamp<std::int64_t>(us, 0, kMax)};
}

}  // namespace rtpm::c
