#include "rtpm_side.hpp"

#include <bench.rtpm.hpp>
#include <cstring>
#include <utility>

namespace rtpm::bench {
namespace {

class EchoServantImpl final : public EchoServant {
 public:
  rpc::Result<Wrench> echo(const Wrench& request, const rpc::CallContext&) override {
    return request;
  }
  rpc::Result<void> work(const Work& request, const rpc::CallContext&) override {
    compute_for(std::chrono::microseconds{request.duration_us()});
    return {};
  }
};

class RtpmCaller final : public Caller {
 public:
  explicit RtpmCaller(EchoClient client) : client_(std::move(client)) {}

  expected<void, std::string> echo() override {
    const auto reply = client_.echo(wrench_);
    if (!reply) return unexpected{std::string(rpc::to_string(reply.error()))};
    // The very bytes are to come back.
    // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison)
    if (std::memcmp(&*reply, &wrench_, sizeof wrench_) != 0) {
      return unexpected{std::string("RTPM's echo differs")};
    }
    return {};
  }

  expected<void, std::string> work(Duration duration) override {
    const auto us = std::chrono::duration_cast<std::chrono::microseconds>(duration).count();
    const auto reply = client_.work(Work(static_cast<std::uint64_t>(us)));
    if (!reply) return unexpected{std::string(rpc::to_string(reply.error()))};
    return {};
  }

 private:
  EchoClient client_;
  Wrench wrench_{1.0, -2.0, 3.0, -4.0, 5.0, -6.0};
};

}  // namespace

expected<std::string, std::string> start_rtpm_server(std::vector<rpc::LaneConfig> lanes,
                                                     rt::RealtimeMode realtime) {
  auto server =
      rpc::Server::create({.name = "rtpm-bench", .lanes = std::move(lanes), .realtime = realtime});
  if (!server) return unexpected{server.error().text};
  static auto& servant = *new EchoServantImpl;
  if (auto added = (*server)->add("bench/echo", servant); !added) {
    return unexpected{added.error().text};
  }
  if (auto started = (*server)->start(); !started) return unexpected{started.error().text};
  // Served until the process ends, so never given back.
  return server->release()->url("bench/echo");
}

std::unique_ptr<rpc::Node> make_node(Carrier carrier, const rt::WaitConfig& wait) {
  rpc::NodeConfig config{.wait = wait, .transport = rpc::Transport::kUdp};
  if (carrier == Carrier::kTcp) config.transport = rpc::Transport::kTcp;
  if (carrier == Carrier::kSharedMemory) config.transport = rpc::Transport::kSharedMemory;
  return std::make_unique<rpc::Node>(config);
}

expected<std::unique_ptr<Caller>, std::string> connect_rtpm_caller(rpc::Node& node,
                                                                   const std::string& url,
                                                                   Priority priority) {
  auto client =
      EchoClient::bind(node, url, {.transport = node.config().transport, .warm_up = {priority}});
  if (!client) return unexpected{client.error().text};
  return std::unique_ptr<Caller>(std::make_unique<RtpmCaller>(std::move(*client)));
}

}  // namespace rtpm::bench
