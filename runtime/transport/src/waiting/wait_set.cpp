#include "rtpm/transport/wait_set.hpp"

#include "rtpm/transport/udp.hpp"

namespace rtpm::transport {

bool WaitSet::add_port(UdpPort& port, MutableBytes, SourceTag tag) noexcept {
  return add(port.descriptor(), tag, Trigger::kLevel);
}

}  // namespace rtpm::transport
