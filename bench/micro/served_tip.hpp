#pragma once

#include <cstdlib>
#include <memory>
#include <utility>

#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "tip.hpp"

/// The counted work of whole calls: of the caller's thread and of the lane's.
namespace rtpm::bench::micro {

template <class Made>
auto needed(Made made) {
  if (!made) std::abort();
  return std::move(*made);
}

/// A server with one lane and its caller, both in this program.
class ServedTip {
 public:
  /// @param transport  kLocal: none
  ServedTip(rpc::Transport transport, bool is_tapped)
      : node_({.wait = {.strategy = rt::WaitStrategy::kBlock},
               .transport = transport == rpc::Transport::kLocal ? rpc::Transport::kAuto : transport,
               .collocates = transport == rpc::Transport::kLocal}) {
    rpc::ServerConfig config;
    config.lanes = {{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
    config.realtime = rt::RealtimeMode::kOff;
    server_ = needed(rpc::Server::create(std::move(config)));
    if (!server_->add("tip", tip_) || !server_->start()) std::abort();
    client_ = std::make_unique<TipClient>(needed(TipClient::bind(node_, server_->url("tip"))));
    if (is_tapped && !server_->tap()->switch_on({})) std::abort();
  }
  ~ServedTip() { server_->stop(); }

  bool call() {
    const auto reply = client_->exchange(wrench_);
    if (reply) wrench_ = *reply;
    return reply.has_value();
  }

 private:
  Tip tip_{};
  std::unique_ptr<rpc::Server> server_;
  rpc::Node node_;
  std::unique_ptr<TipClient> client_;
  Wrench wrench_{1, 2, 3, 4, 5, 6};
};

}  // namespace rtpm::bench::micro
