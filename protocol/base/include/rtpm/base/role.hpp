#pragma once

#include <cstdint>

namespace rtpm::inline base {

/// An identity's rights on an object. Each role includes the previous ones.
enum class Role : std::uint8_t {
  kNone,
  kObserve,     ///< Reads, subscribes, describes.
  kCommand,     ///< Moves and pushes: forces, poses, leases, events.
  kConfigure,   ///< Changes parameters and calibrates.
  kAdminister,  ///< Stops, takes leases away, binds names.
};

}  // namespace rtpm::inline base
