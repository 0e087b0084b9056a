#pragma once

#include <cstddef>
#include <cstdint>

#include "rtpm/wire/limits.hpp"

namespace rtpm::wire {

/// Datagrams may be lost, duplicated, reordered and sent from forged addresses; streams have none
/// of these faults.
enum class Medium : std::uint8_t { kDatagram, kStream };

/// The largest payload of one frame.
[[nodiscard]] constexpr std::size_t frame_payload_max(Medium medium) noexcept {
  return medium == Medium::kDatagram ? kDatagramPayloadSizeMax : kStreamPayloadSizeMax;
}

/// How many fragments of a message may be unacknowledged.
[[nodiscard]] constexpr std::uint16_t window_of(Medium medium) noexcept {
  return medium == Medium::kDatagram ? kFragmentWindow : kStreamFragmentWindow;
}

}  // namespace rtpm::wire
