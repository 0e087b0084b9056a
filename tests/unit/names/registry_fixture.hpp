#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/names/defaults.hpp"
#include "rtpm/names/servant.hpp"
#include "rtpm/test/serve.hpp"

namespace rtpm::names {

/// A server with one object at the registry's path, which a test may stop and start again at the
/// same address.
class ServedRegistry {
 public:
  explicit ServedRegistry(Limits limits = {}, std::vector<rpc::LaneConfig> lanes = {})
      : limits_(limits), lanes_(std::move(lanes)) {
    start();
  }
  /// Serves at the given port.
  explicit ServedRegistry(std::uint16_t port) : port_(port) { start(); }
  /// Serves `servant` instead of a registry; it must outlive this.
  explicit ServedRegistry(rpc::Servant& servant) : other_(&servant) { start(); }

  void start() {
    if (other_ == nullptr) servant_ = make_servant(limits_);
    server_ = test::serve(kRegistryPath, other_ != nullptr ? *other_ : *servant_,
                          {.name = "registry",
                           .port = port_,
                           .lanes = lanes_,
                           .deferred_call_count_max = 160,
                           .stream_count_max = 128,
                           .stream_byte_max = 64 * 1024});
    port_ = server_->port();
  }
  /// Stops the server, which loses all its names.
  void stop() {
    server_.reset();
    servant_.reset();
  }

  [[nodiscard]] std::string url() const {
    return "rtpm://127.0.0.1:" + std::to_string(port_) + "/" + std::string(kRegistryPath);
  }
  [[nodiscard]] rpc::Server& server() { return *server_; }

 private:
  Limits limits_{};
  std::vector<rpc::LaneConfig> lanes_{};
  rpc::Servant* other_ = nullptr;
  std::uint16_t port_ = 0;
  std::unique_ptr<rpc::Servant> servant_;
  std::unique_ptr<rpc::Server> server_;
};

/// A URL without a server; its port was free a moment ago.
[[nodiscard]] inline std::string unserved_url() {
  ServedRegistry registry;
  registry.stop();
  return registry.url();
}

}  // namespace rtpm::names
