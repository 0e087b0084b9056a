#include "rtpm/rpc/node.hpp"

#include "node_impl.hpp"
#include "rtpm/rt/host.hpp"

namespace rtpm::rpc {

std::string_view to_string(Transport transport) noexcept {
  switch (transport) {
    case Transport::kAuto:
      return "auto";
    case Transport::kUdp:
      return "udp";
    case Transport::kTcp:
      return "tcp";
    case Transport::kSharedMemory:
      return "shm";
    case Transport::kLocal:
      return "local";
  }
  return "unknown";
}

Node::Impl::Impl(NodeConfig node_config)
    : config(std::move(node_config)),
      local_channels(config.channel_count_max, config.message_size_max),
      epoch_(rt::random_u64()),
      clock_domain_(rt::clock_domain()) {
  // On one CPU a caller that spins only keeps the server from running.
  if (rt::usable_cpu_count() == 1 && config.wait.strategy == rt::WaitStrategy::kAdaptive) {
    config.wait.strategy = rt::WaitStrategy::kBlock;
  }
}

Endpoint& Node::Impl::endpoint(const ServerAddress& address) {
  const std::lock_guard lock(mutex_);
  auto& endpoint = endpoints_[address];
  if (!endpoint) endpoint = std::make_unique<Endpoint>(address, config, epoch_, clock_domain_);
  return *endpoint;
}

Endpoint& Node::Impl::private_endpoint(const ServerAddress& address) {
  const std::lock_guard lock(mutex_);
  for (PrivateEndpoint& each : private_endpoints_) {
    if (each.is_taken || each.endpoint->address() != address) continue;
    each.is_taken = true;
    return *each.endpoint;
  }
  private_endpoints_.push_back(
      {std::make_unique<Endpoint>(address, config, epoch_, clock_domain_), /*is_taken=*/true});
  return *private_endpoints_.back().endpoint;
}

void Node::Impl::give_back(Endpoint& endpoint) noexcept {
  const std::lock_guard lock(mutex_);
  for (PrivateEndpoint& each : private_endpoints_) {
    if (each.endpoint.get() == &endpoint) each.is_taken = false;
  }
}

Node::Node(NodeConfig config) : impl_(std::make_unique<Impl>(std::move(config))) {}
Node::~Node() = default;

void Node::use(Resolver& resolver) noexcept {
  impl_->resolver = &resolver;
}
const NodeConfig& Node::config() const noexcept {
  return impl_->config;
}

}  // namespace rtpm::rpc
