#include "rtpm/rpc/node.hpp"

#include <algorithm>
#include <mutex>

#include "client/node_impl.hpp"
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
  // On one CPU a spinning caller only keeps the server from running.
  if (rt::usable_cpu_count() == 1 && config.wait.strategy == rt::WaitStrategy::kAdaptive) {
    config.wait.strategy = rt::WaitStrategy::kBlock;
  }
}

Endpoint& Node::Impl::endpoint(const ServerAddress& address, bool is_private) {
  const std::lock_guard lock(mutex_);
  for (Kept& kept : endpoints_) {
    if (kept.is_private != is_private || kept.endpoint->address() != address) continue;
    if (is_private && kept.endpoint->user_count() > 0) continue;
    kept.endpoint->add_user();
    return *kept.endpoint;
  }
  free_unused();
  endpoints_.push_back(
      {.endpoint = std::make_unique<Endpoint>(address, config, keys, epoch_, clock_domain_),
       .is_private = is_private});
  endpoints_.back().endpoint->add_user();
  return *endpoints_.back().endpoint;
}

void Node::Impl::give_back(Endpoint& endpoint) noexcept {
  const std::lock_guard lock(mutex_);
  for (Kept& kept : endpoints_) {
    if (kept.endpoint.get() != &endpoint) continue;
    kept.endpoint->remove_user();
    kept.last_use = ++use_count_;
  }
}

// Frees endpoints without bindings, except the most recently used ones.
void Node::Impl::free_unused() noexcept {
  const auto is_unused = [](const Kept& kept) { return kept.endpoint->user_count() == 0; };
  auto unused_count = std::ranges::count_if(endpoints_, is_unused);
  if (unused_count < static_cast<std::ptrdiff_t>(kUnusedEndpointMax)) return;
  std::ranges::sort(endpoints_, {}, &Kept::last_use);
  std::erase_if(endpoints_, [&](Kept& kept) {
    if (unused_count < static_cast<std::ptrdiff_t>(kUnusedEndpointMax) || !is_unused(kept) ||
        !kept.endpoint->try_end()) {
      return false;
    }
    --unused_count;
    return true;
  });
}

std::size_t Node::Impl::endpoint_count() {
  const std::lock_guard lock(mutex_);
  return endpoints_.size();
}

Node::Node(NodeConfig config) : impl_(std::make_unique<Impl>(std::move(config))) {}
Node::~Node() = default;

void Node::use(Resolver& resolver) noexcept {
  impl_->rebinder().use(&resolver);
}
void Node::forget(Resolver& resolver) noexcept {
  if (impl_->resolver() == &resolver) impl_->rebinder().use(nullptr);
}
void Node::look_again(std::string_view name) noexcept {
  impl_->rebinder().look_again(name);
}

const NodeConfig& Node::config() const noexcept {
  return impl_->config;
}

}  // namespace rtpm::rpc
