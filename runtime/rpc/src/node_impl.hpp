#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "endpoint.hpp"
#include "local.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::rpc {

class Node::Impl {
 public:
  explicit Impl(NodeConfig config);

  /// The endpoint of the address, made at its first use.   Set-up only.
  [[nodiscard]] Endpoint& endpoint(const ServerAddress& address);
  /// An endpoint that nobody else uses until it is given back.   Set-up only.
  [[nodiscard]] Endpoint& private_endpoint(const ServerAddress& address);
  void give_back(Endpoint& endpoint) noexcept;

  NodeConfig config;
  Resolver* resolver = nullptr;
  LocalChannels local_channels;

 private:
  std::uint64_t epoch_;
  std::uint64_t clock_domain_;
  rt::PiMutex mutex_;
  std::map<ServerAddress, std::unique_ptr<Endpoint>> endpoints_;
  struct PrivateEndpoint {
    std::unique_ptr<Endpoint> endpoint;
    bool is_taken = false;
  };
  std::vector<PrivateEndpoint> private_endpoints_;
};

}  // namespace rtpm::rpc
