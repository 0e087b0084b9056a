#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "rtpm/transport/udp.hpp"

namespace rtpm::rpc::test {

/// The ports of a lane that serves 127.0.0.1.
inline std::vector<transport::UdpPort> one_port(std::uint16_t number) {
  std::vector<transport::UdpPort> ports;
  ports.push_back(std::move(*transport::UdpPort::open({.port = number})));
  return ports;
}

}  // namespace rtpm::rpc::test
