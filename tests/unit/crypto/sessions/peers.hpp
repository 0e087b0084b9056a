#pragma once

#include <gtest/gtest.h>

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/sealed/client.hpp"
#include "rtpm/sealed/server.hpp"

/// A client and a server of sealed sessions; the test controls the wire between them.
namespace rtpm::sealed::test {

using Bytes = std::vector<std::byte>;
using wire::DropReason;
using wire::FrameKind;

inline constexpr Priority kPriority{1000};
inline constexpr wire::PeerAddress kClientAddress{.low = 1, .port = 7};

/// One frame over a stream.
inline constexpr std::uint32_t kMessageSizeMax =
    static_cast<std::uint32_t>(wire::sealed_payload_max(wire::Medium::kStream));

inline Bytes copy_of(ConstBytes frame) {
  return {frame.begin(), frame.end()};
}
inline wire::Header header_of(const Bytes& frame) {
  Bytes plain = frame;
  if (wire::is_sealed(plain)) wire::unmark_sealed(plain.data());
  return *wire::decode(plain);
}

/// Admits all clients, or none.
class Door : public Admission {
 public:
  bool admits(const crypto::PublicKey& client, const wire::PeerAddress&) noexcept override {
    asked_for = client;
    return is_open;
  }
  bool admits_unsealed(const wire::PeerAddress&) noexcept override { return is_open_for_all; }
  Priority ceiling(ClientKey client, const wire::PeerAddress&) noexcept override {
    return client != nullptr ? ceiling_of_keys : ceiling_of_all;
  }
  bool admits_handshake(MonotonicTime) noexcept override { return has_time; }
  bool is_open = true;
  bool is_open_for_all = true;
  bool has_time = true;
  Priority ceiling_of_keys = Priority::kHighest;
  Priority ceiling_of_all = Priority::kHighest;
  std::optional<crypto::PublicKey> asked_for;
};

/// A lane that answers each call with the call's own payload.
class Server {
 public:
  explicit Server(wire::Medium medium = wire::Medium::kDatagram, std::uint8_t suites = 3,
                  bool takes_unsealed = false, std::uint32_t session_count_max = 8)
      : medium_(medium),
        suites_(suites),
        takes_unsealed_(takes_unsealed),
        session_count_max_(session_count_max) {
    identity.key = crypto::KeyPair::generate();
    restart();
  }
  /// Restarts the server with the same key.
  void restart() {
    sealed.reset();
    wire::ServerSessionsConfig config;
    config.medium = medium_;
    config.epoch = ++epoch_;
    config.key = {epoch_, 5};
    config.session_count_max = session_count_max_;
    config.message_size_max = kMessageSizeMax;
    config.frame_payload_max = static_cast<std::uint32_t>(wire::sealed_payload_max(medium_));
    sessions = std::make_unique<wire::ServerSessions>(config);
    identity.suites = suites_ & crypto::suites_here();
    SealedServerConfig sealing{.medium = medium_,
                               .identity = &identity,
                               .admission = &door,
                               .key = config.key,
                               .session_count_max = session_count_max_,
                               .takes_unsealed = takes_unsealed_};
    memory.assign(SealedServer::memory_size(sealing) / sizeof(Line), {});
    sealing.memory = secrets.empty() ? std::as_writable_bytes(std::span(memory)) : secrets;
    sealed = std::make_unique<SealedServer>(sealing, *sessions);
  }
  /// Returns the frames that the server sends in response to `frame`.
  std::vector<Bytes> receive(Bytes frame, MonotonicTime now,
                             const wire::PeerAddress& peer = kClientAddress) {
    std::vector<Bytes> sent;
    has_hung_up = false;
    SealedServer::Outcome outcome = sealed->on_frame(frame, peer, now);
    job_count += outcome.job != nullptr ? 1 : 0;
    while (true) {
      if (outcome.verdict.action == wire::Verdict::Action::kHangUp) has_hung_up = true;
      if (outcome.verdict.action == wire::Verdict::Action::kSend) {
        add(sent, outcome.verdict.frame);
      } else if (outcome.verdict.action == wire::Verdict::Action::kDispatch) {
        ++run_count;
        const wire::Request& request = outcome.verdict.request;
        last_deadline = request.deadline;
        const MutableBytes reply = sessions->reply_buffer(request, now);
        std::ranges::copy(request.payload, reply.begin());
        add(sent, sessions->complete(request, wire::Status::kOk,
                                     static_cast<std::uint32_t>(request.payload.size()), now));
      }
      if (outcome.job == nullptr) return sent;
      HandshakeJob& job = *outcome.job;
      job.run();
      if (auto line = job.key_log_line()) key_log += *line + "\n";
      outcome = sealed->on_job(job, now);
    }
  }

  struct alignas(64) Line {
    std::byte bytes[64];
  };
  ServerIdentity identity;
  Door door;
  std::vector<Line> memory;  ///< Holds the session keys before restart().
  MutableBytes secrets{};    ///< Holds the session keys from restart() on.
  std::unique_ptr<wire::ServerSessions> sessions;
  std::unique_ptr<SealedServer> sealed;
  int run_count = 0;
  MonotonicTime last_deadline{};
  int job_count = 0;
  std::string key_log;
  bool has_hung_up = false;

 private:
  void add(std::vector<Bytes>& sent, ConstBytes frame) {
    const ConstBytes out = sealed->seal(frame);
    if (!out.empty()) sent.push_back(copy_of(out));
  }

  wire::Medium medium_;
  std::uint8_t suites_;
  bool takes_unsealed_;
  std::uint32_t session_count_max_;
  std::uint64_t epoch_ = 100;
};

/// A channel with its seal.
class Client {
 public:
  explicit Client(const crypto::PublicKey& server, wire::Medium medium = wire::Medium::kDatagram,
                  std::uint8_t suites = 3, crypto::KeyPair own = crypto::KeyPair::generate())
      : key(std::move(own)),
        channel({.medium = medium,
                 .client_epoch = 3,
                 .channel = 1,
                 .message_size_max = kMessageSizeMax},
                MutableBytes(buffer_).first(wire::kHeaderSize + wire::sealed_payload_max(medium))),
        sealed(
            SealedClientConfig{.medium = medium,
                               .own = &key,
                               .server = server,
                               .suites = static_cast<std::uint8_t>(suites & crypto::suites_here()),
                               .handshake_number = 50}) {}
  void open(MonotonicTime now) {
    send(channel.open(kPriority, now + std::chrono::seconds{10}, now), now);
  }
  void call(std::string_view text, MonotonicTime now, Duration budget = std::chrono::seconds{20}) {
    payload_ = copy_of(std::as_bytes(std::span(text)));
    const auto frame =
        channel.call({.service = 1, .method = 1, .priority = kPriority, .deadline = now + budget},
                     payload_, now);
    ASSERT_TRUE(frame);
    send(*frame, now);
  }
  void call_when_ready(std::string_view text, MonotonicTime now) {
    if (channel.is_ready() && payload_.empty()) call(text, now);
  }
  void renew(MonotonicTime now) { follow(sealed.renew(now), now); }
  void send(ConstBytes frame, MonotonicTime now) {
    if (!frame.empty()) follow(sealed.send(frame, now), now);
  }
  void receive(Bytes frame, MonotonicTime now) { follow(sealed.receive(frame, now), now); }
  void on_time(MonotonicTime now) {
    while (true) {
      const wire::ChannelEvent event = channel.on_time(now);
      if (event.kind == wire::ChannelEvent::Kind::kNothing) return;
      take(event, now);
    }
  }

  crypto::KeyPair key;

 private:
  std::array<std::byte, wire::kStreamFrameSizeMax> buffer_{};

 public:
  wire::ClientChannel channel;
  SealedClient sealed;
  std::deque<Bytes> sent;                        ///< Frames in flight to the server.
  std::vector<wire::ChannelEvent::Kind> events;  ///< The channel's reports.
  std::string reply;                             ///< The last reply.
  bool is_broken = false;

 private:
  void follow(const SealedClient::Step& step, MonotonicTime now) {
    is_broken = is_broken || step.is_broken;
    if (!step.send.empty()) sent.push_back(copy_of(step.send));
    if (!step.deliver.empty()) take(channel.on_frame(copy_of(step.deliver), now), now);
    if (sealed.has_work()) follow(sealed.work(now), now);
  }
  void take(const wire::ChannelEvent& event, MonotonicTime now) {
    if (event.kind != wire::ChannelEvent::Kind::kNothing) events.push_back(event.kind);
    if (event.kind == wire::ChannelEvent::Kind::kReply) {
      reply.assign(reinterpret_cast<const char*>(event.payload.data()), event.payload.size());
    }
    send(event.frame, now);
  }
  Bytes payload_;
};

/// Exchanges frames until none is in flight; each side reads its own clock.
inline void talk(Client& client, Server& server, MonotonicTime client_now, MonotonicTime server_now,
                 const wire::PeerAddress& peer = kClientAddress) {
  while (!client.sent.empty()) {
    const Bytes frame = client.sent.front();
    client.sent.pop_front();
    for (const Bytes& answer : server.receive(frame, server_now, peer))
      client.receive(answer, client_now);
  }
}
inline void talk(Client& client, Server& server, MonotonicTime now) {
  talk(client, server, now, now);
}

/// Opens a session, and makes the first call in it.
inline void open_and_call(Client& client, Server& server, MonotonicTime now) {
  client.open(now);
  talk(client, server, now);
  client.call("one", now);
  talk(client, server, now);
}

}  // namespace rtpm::sealed::test
