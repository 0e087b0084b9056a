#pragma once

#include <array>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <utility>

#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "wrench.rtpm.hpp"

/// Calls of 48 bytes through generated code.
namespace rtpm::bench::micro {

class Tip final : public TipServant {
 public:
  rpc::Result<Wrench> exchange(const Wrench& request, const rpc::CallContext&) override {
    return Wrench(request.fx() + 1, request.fy(), request.fz(), request.tx(), request.ty(),
                  request.tz());
  }
};

inline const rpc::CallContext kContext{
    .priority = 0, .deadline = kNever, .received = {}, .trace_id = 0};

/// A call of 48 bytes as the stub encodes it, the skeleton dispatches it and the stub decodes its
/// reply, with nothing between; false if it failed.
struct GeneratedCall {
  alignas(16) std::array<std::byte, 64> request{};
  alignas(16) std::array<std::byte, 64> reply{};
  Wrench wrench{1, 2, 3, 4, 5, 6};

  bool run(rpc::Servant& servant) {
    // The stub's side: the request's bytes go into the transport's memory.
    const ConstBytes bytes = rpc::struct_bytes(wrench);
    std::memcpy(request.data(), bytes.data(), bytes.size());
    asm volatile("" : : : "memory");
    const rpc::DispatchResult result =
        servant.dispatch(1, {request.data(), bytes.size()}, reply, kContext);
    if (result.reply_size != sizeof wrench) return false;
    std::memcpy(&wrench, reply.data(), sizeof wrench);
    return true;
  }
};

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
