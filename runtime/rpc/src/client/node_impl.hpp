#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "client/endpoint.hpp"
#include "client/rebinder.hpp"
#include "local/local.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::rpc {

class Node::Impl {
 public:
  explicit Impl(NodeConfig config);

  /// The most unused endpoints whose sessions are kept for future bindings.
  static constexpr std::size_t kUnusedEndpointMax = 16;

  /// The endpoint of the address. Created at its first use; each use must be given back. A private
  /// one shares its channels with no other binding.
  /// @realtime set-up only
  [[nodiscard]] Endpoint& endpoint(const ServerAddress& address, bool is_private);
  void give_back(Endpoint& endpoint) noexcept;

  [[nodiscard]] Resolver* resolver() const noexcept { return rebinder_.resolver(); }
  [[nodiscard]] Rebinder& rebinder() noexcept { return rebinder_; }
  /// The number of endpoints. For tests.
  [[nodiscard]] std::size_t endpoint_count();

  NodeConfig config;
  NodeKeys keys{config.security};
  LocalChannels local_channels;

 private:
  void free_unused() noexcept;

  std::uint64_t epoch_;
  std::uint64_t clock_domain_;
  rt::PiMutex mutex_;
  struct Kept {
    std::unique_ptr<Endpoint> endpoint;
    bool is_private = false;
    std::uint64_t last_use = 0;  ///< Higher means later.
  };
  std::vector<Kept> endpoints_;
  std::uint64_t use_count_ = 0;
  Rebinder rebinder_;  ///< Destroyed first: its thread binds.
};

}  // namespace rtpm::rpc
