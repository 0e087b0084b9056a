#pragma once

#include <cstdint>
#include <string>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::ros2 {

/// Which hosts take part in automatic discovery.
enum class DiscoveryRange : std::uint8_t { kSubnet, kLocalhost };

/// The domain that ROS 2 programs of the same environment use.
struct Domain {
  std::uint32_t id = 0;  ///< 0 to 101.
  DiscoveryRange range = DiscoveryRange::kSubnet;
};

/// Reads ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE.
/// @realtime set-up only
/// @errors   a number beyond 101; a range other than SUBNET, LOCALHOST and SYSTEM_DEFAULT
[[nodiscard]] expected<Domain, SetupError> domain_of_environment();

}  // namespace rtpm::ros2
