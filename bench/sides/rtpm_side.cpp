#include "sides/rtpm_side.hpp"

#include <algorithm>
#include <bench.rtpm.hpp>
#include <cstring>
#include <optional>
#include <utility>

namespace rtpm::bench {
namespace {

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

/// Returns nothing if the reply arrived and equals `sent` byte by byte.
template <class Reply, class Sent>
expected<void, std::string> check_echo(const Reply& reply, const Sent& sent) {
  if (!reply) return unexpected{std::string(rpc::to_string(reply.error()))};
  // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison)
  if (std::memcmp(&*reply, &sent, sizeof sent) == 0) return {};
  return unexpected{std::string("RTPM's echo differs")};
}

expected<void, std::string> check_done(const expected<void, rpc::CallError>& reply) {
  if (reply) return {};
  return unexpected{std::string(rpc::to_string(reply.error()))};
}

class RtpmCaller final : public Caller {
 public:
  explicit RtpmCaller(EchoClient client) : client_(std::move(client)) {}

  expected<void, std::string> echo() override { return check_echo(client_.echo(wrench_), wrench_); }
  expected<void, std::string> work(Duration duration) override {
    const auto us = std::chrono::duration_cast<std::chrono::microseconds>(duration).count();
    return check_done(client_.work(Work(static_cast<std::uint64_t>(us))));
  }

 private:
  EchoClient client_;
  Wrench wrench_{1.0, -2.0, 3.0, -4.0, 5.0, -6.0};
};

/// Makes calls with another payload than the usual one; the server computes nothing in them.
class RtpmPayloadCaller final : public Caller {
 public:
  explicit RtpmPayloadCaller(Job job) : job_(std::move(job)) {}
  expected<void, std::string> echo() override { return job_(); }

 private:
  Job job_;
};

/// Each call has a channel of its own.
class RtpmPipeline final : public Pipeline {
 public:
  explicit RtpmPipeline(EchoClient client) : client_(std::move(client)), pending_(kInFlight) {}

  expected<void, std::string> run(std::uint64_t count) override {
    std::uint64_t begun = 0;
    for (std::uint64_t taken = 0; taken < count; ++taken) {
      for (; begun < std::min(count, taken + pending_.size()); ++begun) {
        auto call = client_.begin_echo(wrench_);
        if (!call) return unexpected{std::string(rpc::to_string(call.error()))};
        pending_[begun % pending_.size()].emplace(std::move(*call));
      }
      const auto reply = pending_[taken % pending_.size()]->take();
      if (auto echoed = check_echo(reply, wrench_); !echoed) return echoed;
    }
    return {};
  }

 private:
  EchoClient client_;
  std::vector<std::optional<rpc::PendingStruct<Wrench>>> pending_;
  Wrench wrench_{1.0, -2.0, 3.0, -4.0, 5.0, -6.0};
};

expected<EchoClient, std::string> bind_echo(rpc::Node& node, const std::string& url,
                                            Priority priority) {
  auto client =
      EchoClient::bind(node, url, {.transport = node.config().transport, .warm_up = {priority}});
  if (!client) return unexpected{client.error().text()};
  return std::move(*client);
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

}  // namespace

expected<std::unique_ptr<rpc::Server>, std::string> open_server(const rpc::ServerConfig& config,
                                                                std::string_view path,
                                                                rpc::Servant& servant) {
  auto server = rpc::Server::create(config);
  if (!server) return unexpected{server.error().text()};
  if (auto added = (*server)->add(path, servant); !added) return unexpected{added.error().text()};
  return std::move(*server);
}

expected<std::string, std::string> start_rtpm_server(RtpmServerConfig config) {
  static auto& servant = *new EchoServantImpl;
  auto server = open_server({.name = "rtpm-bench",
                             .host = std::move(config.host),
                             .lanes = std::move(config.lanes),
                             .realtime = config.realtime,
                             .session_count_max = config.session_count_max,
                             .security = std::move(config.security)},
                            "bench/echo", servant);
  if (!server) return unexpected{server.error()};
  if (auto started = (*server)->start(); !started) return unexpected{started.error().text()};
  // The server runs until the process ends, so it is never freed.
  return server->release()->url("bench/echo");
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

expected<std::unique_ptr<Caller>, std::string> connect_rtpm_caller(rpc::Node& node,
                                                                   const std::string& url,
                                                                   Priority priority,
                                                                   std::size_t payload_size) {
  if (payload_size != 0 && payload_size != kPayloadSize) {
    auto job = connect_large_job(node, url, priority, payload_size);
    if (!job) return unexpected{job.error()};
    return std::make_unique<RtpmPayloadCaller>(std::move(*job));
  }
  auto client = bind_echo(node, url, priority);
  if (!client) return unexpected{client.error()};
  if (payload_size == kPayloadSize) return std::make_unique<RtpmCaller>(std::move(*client));
  return std::make_unique<RtpmPayloadCaller>(
      [held = std::make_shared<EchoClient>(std::move(*client))] {
        return check_done(held->nothing());
      });
}

expected<Job, std::string> connect_large_job(rpc::Node& node, const std::string& url,
                                             Priority priority, std::size_t size) {
  auto client = bind_echo(node, url, priority);
  if (!client) return unexpected{client.error()};
  // Shared, because a job is copied.
  auto held = std::make_shared<EchoClient>(std::move(*client));
  auto message = std::make_shared<flatbuffers::DetachedBuffer>(encode_large(size));
  return Job([held, message]() -> expected<void, std::string> {
    const auto reply =
        held->echo_large_encoded(std::as_bytes(std::span(message->data(), message->size())));
    if (!reply) return unexpected{std::string(rpc::to_string(reply.error()))};
    const auto& sent = *flatbuffers::GetRoot<Large>(message->data())->bytes();
    const auto& got = *(*reply)->bytes();
    if (got.size() == sent.size() && std::memcmp(got.data(), sent.data(), sent.size()) == 0) {
      return {};
    }
    return unexpected{std::string("RTPM's large echo differs")};
  });
}

expected<std::unique_ptr<Pipeline>, std::string> connect_rtpm_pipeline(rpc::Node& node,
                                                                       const std::string& url,
                                                                       Priority priority) {
  auto client = bind_echo(node, url, priority);
  if (!client) return unexpected{client.error()};
  return std::make_unique<RtpmPipeline>(std::move(*client));
}

}  // namespace rtpm::bench
