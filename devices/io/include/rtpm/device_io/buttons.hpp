#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "rtpm/driver/sample.hpp"

/// Counts of presses and releases, modulo 65536.
/// @realtime alloc-free
namespace rtpm::device_io {

/// Increments the edge counter of each button whose bit differs; ignores buttons beyond `edges`.
inline void count_edges(std::uint32_t before, std::uint32_t after,
                        std::span<std::uint16_t> edges) noexcept {
  for (std::size_t i = 0; i < edges.size(); ++i)
    edges[i] = static_cast<std::uint16_t>(edges[i] + ((before ^ after) >> i & 1U));
}

/// Sets the sample's buttons and adds the edges counted since the last sample. A button that
/// differs despite an even count changed while the device was unplugged: that adds one more edge.
/// @param edges_before, edges_now  two readings of the same counters, with equal sizes
inline void take_buttons(driver::Sample& sample, std::uint32_t buttons,
                         std::span<const std::uint16_t> edges_before,
                         std::span<const std::uint16_t> edges_now) noexcept {
  for (std::size_t i = 0; i < edges_now.size(); ++i) {
    const unsigned edges = unsigned{edges_now[i]} - edges_before[i];
    const unsigned changed = (sample.buttons ^ buttons) >> i & 1U;
    sample.button_edges[i] =
        static_cast<std::uint16_t>(sample.button_edges[i] + edges + ((edges ^ changed) & 1U));
  }
  sample.buttons = buttons;
}

}  // namespace rtpm::device_io
