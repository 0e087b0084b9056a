#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "rtpm/rpc/node.hpp"

/// The name of a lease's holder, for people.
namespace rtpm::gvd {

/// The most bytes of a holder's name that are kept.
inline constexpr std::size_t kHolderNameSizeMax = 120;

/// The path of the object that names the holder of `device`'s lease.
[[nodiscard]] inline std::string holder_path(std::string_view device) {
  return std::string(device) + "/holder";
}

/// "PROGRAM on HOST" of this process; of a Python program its script or module.
/// @realtime set-up only
[[nodiscard]] std::string own_holder_name();

/// Names the holder of `lease` to the device at `device_url`. Without effect if its server is older,
/// or does not answer within 200 ms: the lease is the same without a name.
/// @realtime set-up only
void introduce(rpc::Node& node, std::string_view device_url, std::uint64_t lease,
               std::string_view name);

}  // namespace rtpm::gvd
