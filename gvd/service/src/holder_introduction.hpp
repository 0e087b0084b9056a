#pragma once

#include <cstdint>
#include <holder.rtpm.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "rtpm/rpc/node.hpp"

namespace rtpm::gvd {

/// Names this program to a device as the holder of its leases. Bound before the first lease, since
/// a lease lapses while its holder waits. Without effect if the server is older.
/// @ownership refers to its node
/// @threads  one at a time
class HolderIntroduction {
 public:
  HolderIntroduction(rpc::Node& node, std::string_view device_url);
  void tell(std::uint64_t lease);

 private:
  std::optional<device::LeaseHolderClient> stub_{};
  std::string name_;
};

}  // namespace rtpm::gvd
