#pragma once

#include <cstdint>

namespace rtpm::inline base {

/// An identity's rights to an object. Each role includes those before it.
enum class Role : std::uint8_t {
  kNone,
  kObserve,     ///< Reads, subscribes, describes.
  kCommand,     ///< Moves and pushes: forces, poses, leases, events.
  kConfigure,   ///< Changes parameters, calibrates.
  kAdminister,  ///< Stops, takes leases away, binds names.
};

}  // namespace rtpm::inline base
