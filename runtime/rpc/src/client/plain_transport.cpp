#include "client/plain_transport.hpp"

#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::rpc {

expected<std::unique_ptr<transport::ClientTransport>, SetupError> open_plain_transport(
    const ServerAddress& address, NodeKeys& keys, Priority priority, MonotonicTime deadline) {
  switch (address.transport) {
    case Transport::kTcp:
      return transport::open_tcp_transport(address.host, address.port, priority,
                                           wire::kStreamPayloadSizeMax, deadline);
    case Transport::kSharedMemory:
      return transport::open_shared_memory_transport(
          {address.host, address.port, address.memory_folder, keys.trusted_users()}, priority,
          deadline);
    case Transport::kUdp:
    case Transport::kAuto:
    case Transport::kLocal:
      break;
  }
  return transport::open_udp_transport(address.host, address.port, priority);
}

}  // namespace rtpm::rpc
