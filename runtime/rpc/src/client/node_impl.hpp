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

  /// The most endpoints without a binding that are kept with their sessions, for bindings to come.
  static constexpr std::size_t kUnusedEndpointMax = 16;

  /// The endpoint of the address, made at its first use, until it is given back as often. A private
  /// one that no other channel uses meanwhile.
  /// @realtime set-up only
  [[nodiscard]] Endpoint& endpoint(const ServerAddress& address, bool is_private);
  void give_back(Endpoint& endpoint) noexcept;

  [[nodiscard]] Resolver* resolver() const noexcept { return rebinder_.resolver(); }
  [[nodiscard]] Rebinder& rebinder() noexcept { return rebinder_; }
  /// How many endpoints there are.   For tests.
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
    std::uint64_t last_use = 0;  ///< The higher, the later.
  };
  std::vector<Kept> endpoints_;
  std::uint64_t use_count_ = 0;
  Rebinder rebinder_;  ///< Ends first: its thread binds.
};

}  // namespace rtpm::rpc
