#pragma once

#include <cstddef>
#include <cstdint>

#include "rtpm/wire/limits.hpp"

namespace rtpm::wire {

/// Whether frames travel as datagrams, which get lost, doubled and reordered and whose addresses
/// can be forged, or on a stream, where none of this happens.
enum class Medium : std::uint8_t { kDatagram, kStream };

/// The largest payload of one frame.
[[nodiscard]] constexpr std::size_t frame_payload_max(Medium medium) noexcept {
  return medium == Medium::kDatagram ? kDatagramPayloadSizeMax : kStreamPayloadSizeMax;
}

/// How many fragments of a message may be on their way.
[[nodiscard]] constexpr std::uint16_t window_of(Medium medium) noexcept {
  return medium == Medium::kDatagram ? kFragmentWindow : kStreamFragmentWindow;
}

}  // namespace rtpm::wire
