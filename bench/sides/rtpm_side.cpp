#include "sides/rtpm_side.hpp"

#include <algorithm>
#include <bench.rtpm.hpp>
#include <cstring>
#include <optional>
#include <utility>

namespace rtpm::bench {
namespace {

constexpr const char* kPath = "bench/echo";
const Wrench kWrench{1.0, -2.0, 3.0, -4.0, 5.0, -6.0};

class EchoServantImpl final : public EchoServant {
 public:
  rpc::Result<Wrench> echo(const Wrench& request, const rpc::CallContext&) override {
    return request;
  }
  rpc::Result<void> nothing(const rpc::CallContext&) override { return {}; }
  rpc::Result<void> work(const Work& request, const rpc::CallContext&) override {
    compute_for(std::chrono::microseconds{request.duration_us()});
    return {};
  }
  rpc::Result<void> echo_large(const Large& request, rpc::ReplyBuilder<Large>& reply,
                               const rpc::CallContext&) override {
    const auto bytes =
        reply.builder().CreateVector(request.bytes()->data(), request.bytes()->size());
    reply.finish(CreateLarge(reply.builder(), bytes));
    return {};
  }
};

/// Whether the wrench came back byte by byte.
template <class Reply>
Outcome<> check_echo(const Reply& reply) {
  if (!reply) return failure(reply.error());
  // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison)
  if (std::memcmp(&*reply, &kWrench, sizeof kWrench) == 0) return {};
  return failure("RTPM's echo differs");
}

/// The client is shared because calls are copied.
Outcome<std::shared_ptr<EchoClient>> bind_echo(rpc::Node& node, const std::string& url,
                                               Priority priority) {
  auto client =
      EchoClient::bind(node, url, {.transport = node.config().transport, .warm_up = {priority}});
  if (!client) return failure(client.error());
  return std::make_shared<EchoClient>(std::move(*client));
}

/// An encoded message of `size` bytes, all different so that a mix-up shows.
flatbuffers::DetachedBuffer encode_large(std::size_t size) {
  flatbuffers::FlatBufferBuilder builder(size + 64);
  std::uint8_t* bytes = nullptr;
  const auto vector = builder.CreateUninitializedVector(size, &bytes);
  for (std::size_t i = 0; i < size; ++i)
    bytes[i] = static_cast<std::uint8_t>(i ^ (i >> 8) ^ (i >> 16));
  builder.Finish(CreateLarge(builder, vector));
  return builder.Release();
}

Outcome<> echo_large(EchoClient& client, const flatbuffers::DetachedBuffer& message) {
  const auto reply =
      client.echo_large_encoded(std::as_bytes(std::span(message.data(), message.size())));
  if (!reply) return failure(reply.error());
  const auto& sent = *flatbuffers::GetRoot<Large>(message.data())->bytes();
  const auto& got = *(*reply)->bytes();
  if (got.size() == sent.size() && std::memcmp(got.data(), sent.data(), sent.size()) == 0) {
    return {};
  }
  return failure("RTPM's large echo differs");
}

}  // namespace

Outcome<std::unique_ptr<rpc::Server>> open_server(const rpc::ServerConfig& config,
                                                  std::string_view path, rpc::Servant& servant) {
  auto server = rpc::Server::create(config);
  if (!server) return failure(server.error());
  if (auto added = (*server)->add(path, servant); !added) return failure(added.error());
  return std::move(*server);
}

Outcome<std::string> start_rtpm_server(rpc::ServerConfig config) {
  static auto& servant = *new EchoServantImpl;
  config.name = "rtpm-bench";
  auto server = open_server(config, kPath, servant);
  if (!server) return failure(server.error());
  if (auto started = (*server)->start(); !started) return failure(started.error());
  // The server runs until the process ends, so it is never freed.
  return server->release()->url(kPath);
}

rpc::Transport transport_of(Carrier carrier) noexcept {
  if (carrier == Carrier::kUdp) return rpc::Transport::kUdp;
  return carrier == Carrier::kTcp ? rpc::Transport::kTcp : rpc::Transport::kSharedMemory;
}

std::unique_ptr<rpc::Node> make_node(Carrier carrier, const rt::WaitConfig& wait,
                                     rpc::NodeSecurity security) {
  return std::make_unique<rpc::Node>(rpc::NodeConfig{
      .wait = wait, .transport = transport_of(carrier), .security = std::move(security)});
}

Outcome<Call> connect_rtpm_caller(rpc::Node& node, const std::string& url, Priority priority,
                                  std::size_t payload_size) {
  auto client = bind_echo(node, url, priority);
  if (!client) return failure(client.error());
  if (payload_size == 0) {
    return Call([echo = *client](Duration) { return outcome(echo->nothing()); });
  }
  if (payload_size == kPayloadSize) {
    return Call([echo = *client](Duration work) {
      if (work == Duration{0}) return check_echo(echo->echo(kWrench));
      const auto us = std::chrono::duration_cast<std::chrono::microseconds>(work).count();
      return outcome(echo->work(Work(static_cast<std::uint64_t>(us))));
    });
  }
  auto message = std::make_shared<flatbuffers::DetachedBuffer>(encode_large(payload_size));
  return Call([echo = *client, message](Duration) { return echo_large(*echo, *message); });
}

Outcome<Pipeline> connect_rtpm_pipeline(rpc::Node& node, const std::string& url,
                                        Priority priority) {
  auto client = bind_echo(node, url, priority);
  if (!client) return failure(client.error());
  // Each call in flight has a channel of its own.
  using Pending = std::vector<std::optional<rpc::PendingStruct<Wrench>>>;
  return Pipeline([echo = *client, pending = std::make_shared<Pending>(kInFlight)](
                      std::uint64_t count) -> Outcome<> {
    std::uint64_t begun = 0;
    for (std::uint64_t taken = 0; taken < count; ++taken) {
      for (; begun < std::min(count, taken + kInFlight); ++begun) {
        auto call = echo->begin_echo(kWrench);
        if (!call) return failure(call.error());
        (*pending)[begun % kInFlight].emplace(std::move(*call));
      }
      if (auto echoed = check_echo((*pending)[taken % kInFlight]->take()); !echoed) return echoed;
    }
    return {};
  });
}

}  // namespace rtpm::bench
