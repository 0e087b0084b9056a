#pragma once

#include <netinet/udp.h>

// Missing in older C libraries.
#ifndef UDP_SEGMENT
#define UDP_SEGMENT 103
#endif
#ifndef UDP_GRO
#define UDP_GRO 104
#endif

namespace rtpm::transport::os {

/// Whether datagrams can cross the network stack together; by these options of IPPROTO_UDP.
inline constexpr bool kHasBatches = true;
inline constexpr int kSegmentOption = UDP_SEGMENT;
inline constexpr int kBatchOption = UDP_GRO;

}  // namespace rtpm::transport::os
