#pragma once

namespace rtpm::transport::os {

/// Whether datagrams can cross the network stack together; then by these options of IPPROTO_UDP.
inline constexpr bool kHasBatches = false;
inline constexpr int kSegmentOption = -1;
inline constexpr int kBatchOption = -1;

}  // namespace rtpm::transport::os
