#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/sealed/client.hpp"
#include "rtpm/test/raw_peer.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "rtpm/wire/client_channel.hpp"

namespace rtpm::test {

/// A client with a key and one channel, which uses only the protocol's half of RTPM's clients.
class SealedPeer {
 public:
  using Kind = wire::ChannelEvent::Kind;
  /// How a call ended.
  struct Reply {
    Kind kind = Kind::kNothing;  ///< kNothing if it did not end.
    wire::Status status = wire::Status::kOk;
    Bytes payload{};
    [[nodiscard]] bool is_ok() const { return kind == Kind::kReply && status == wire::Status::kOk; }
  };

  SealedPeer(rpc::Transport transport, std::uint16_t port, const crypto::PublicKey& server,
             const crypto::KeyPair& key, Priority priority = 0)
      : key_(key.clone()), priority_(priority) {
    const MonotonicTime deadline = rt::now() + kPatience;
    auto opened =
        transport == rpc::Transport::kTcp
            ? transport::open_tcp_transport("127.0.0.1", port, priority, 1 << 20, deadline)
            : transport::open_udp_transport("127.0.0.1", port, priority);
    EXPECT_TRUE(opened) << opened.error().text();
    if (!opened) return;
    transport_ = std::move(*opened);
    const wire::Medium medium = transport_->medium();
    buffer_.resize(wire::kHeaderSize + wire::sealed_payload_max(medium));
    channel_.emplace(wire::ClientChannelConfig{.medium = medium,
                                               .client_epoch = rt::random_u64(),
                                               .channel = 1,
                                               .message_size_max = 1 << 20},
                     buffer_);
    sealed_.emplace(sealed::SealedClientConfig{
        .medium = medium,
        .own = &key_,
        .server = server,
        .handshake_number = static_cast<std::uint32_t>(rt::random_u64())});
    large_.resize(1 << 20);
    channel_->set_reply_buffer(large_);
  }

  /// Shakes hands; false if the server refuses or does not answer.
  [[nodiscard]] bool open(Duration patience = kPatience) {
    begin_open(patience);
    return await(rt::now() + patience).kind == Kind::kReady;
  }
  void begin_open(Duration patience = kPatience) {
    send(channel_->open(priority_, rt::now() + patience, rt::now()));
  }
  /// Makes a call, and waits for its end.
  Reply call(std::uint16_t method, ConstBytes payload,
             wire::Delivery delivery = wire::Delivery::kReply, Duration patience = kPatience) {
    if (!begin({.method = method, .delivery = delivery}, payload, patience)) return {};
    if (delivery == wire::Delivery::kSent) return {Kind::kReply};
    return await(rt::now() + patience);
  }
  /// Begins a call of the server's first object.
  [[nodiscard]] bool begin(wire::CallParameters parameters, ConstBytes payload,
                           Duration patience = kPatience) {
    parameters.service = 1;
    return begin_any(parameters, payload, patience);
  }
  /// Like begin(), but for any object.
  [[nodiscard]] bool begin_any(wire::CallParameters parameters, ConstBytes payload,
                               Duration patience = kPatience) {
    payload_.assign(payload.begin(), payload.end());
    parameters.priority = priority_;
    parameters.deadline = rt::now() + patience;
    const auto frame = channel_->call(parameters, payload_, rt::now());
    if (!frame) return false;
    send_all(*frame);
    return true;
  }
  /// Begins a stream of items of at most 16 KiB.
  [[nodiscard]] bool begin_stream(std::uint16_t method, std::uint32_t window) {
    constexpr std::size_t kFrameSize = wire::kSharedPayloadSizeMax;
    const wire::Medium medium = transport_->medium();
    const std::uint32_t byte_window = wire::stream_bytes_first(medium);
    frames_.resize(kFrameSize * wire::stream_frame_count(medium, window, byte_window));
    item_.resize(std::size_t{16} * 1024);
    wire::CallParameters parameters;
    parameters.method = method;
    parameters.stream_window = window;
    parameters.stream_buffers = {
        .frames = frames_, .frame_size = kFrameSize, .item = item_, .byte_window = byte_window};
    return begin(parameters, {});
  }
  /// The next item of the only call, if it comes in time.
  [[nodiscard]] std::optional<Bytes> next_item(Duration patience = kPatience) {
    const MonotonicTime until = rt::now() + patience;
    while (true) {
      if (const auto item = channel_->next_item(channel_->last_call())) {
        Bytes copy(item->begin(), item->end());
        send_all(channel_->next_frame(rt::now()));
        return copy;
      }
      if (await(until).kind != Kind::kItems) return std::nullopt;
    }
  }
  /// The next thing that happens.
  [[nodiscard]] Reply await(MonotonicTime until = rt::now() + kPatience) {
    while (happened_.empty()) {
      const auto frame = transport_->receive();
      if (frame) {
        last_frame_.assign(frame->begin(), frame->end());
        follow(sealed_->receive(*frame, rt::now()));
      } else if (frame.error() == transport::IoError::kClosed) {
        return {Kind::kBroken};
      } else if (rt::now() >= until) {
        return {};
      } else {
        transport_->wait(std::min(until, channel_->next_time()));
      }
      while (take(channel_->on_time(rt::now()))) {
      }
    }
    Reply reply = std::move(happened_.front());
    happened_.erase(happened_.begin());
    return reply;
  }

  /// Sends any bytes, valid or not.
  void send_raw(ConstBytes frame) { static_cast<void>(transport_->send(frame)); }
  [[nodiscard]] const Bytes& last_sent() const noexcept { return last_sent_; }
  [[nodiscard]] const Bytes& last_frame() const noexcept { return last_frame_; }
  [[nodiscard]] wire::ClientChannel& channel() noexcept { return *channel_; }
  [[nodiscard]] const sealed::SealedClient& sealed() const noexcept { return *sealed_; }

 private:
  void send(ConstBytes frame) {
    if (!frame.empty()) follow(sealed_->send(frame, rt::now()));
  }
  void send_all(ConstBytes frame) {
    for (; !frame.empty(); frame = channel_->next_frame(rt::now()))
      send(frame);
  }
  void follow(const sealed::SealedClient::Step& step) {
    if (step.is_broken) happened_.push_back({Kind::kBroken});
    if (!step.send.empty()) {
      last_sent_.assign(step.send.begin(), step.send.end());
      static_cast<void>(transport_->send(step.send));
    }
    if (!step.deliver.empty()) {
      const Bytes frame(step.deliver.begin(), step.deliver.end());
      static_cast<void>(take(channel_->on_frame(frame, rt::now())));
    }
    if (sealed_->has_work()) follow(sealed_->work(rt::now()));
  }
  // False means that nothing happened.
  bool take(const wire::ChannelEvent& event) {
    Reply reply{event.kind, event.status, {event.payload.begin(), event.payload.end()}};
    send_all(event.frame);
    if (event.frame.empty()) send_all(channel_->next_frame(rt::now()));
    if (event.kind == Kind::kNothing) return false;
    if (event.kind != Kind::kSend) happened_.push_back(std::move(reply));
    return true;
  }

  crypto::KeyPair key_;
  Priority priority_;
  std::unique_ptr<transport::ClientTransport> transport_;
  Bytes buffer_;
  Bytes large_;
  Bytes payload_;
  Bytes frames_;
  Bytes item_;
  Bytes last_sent_;
  Bytes last_frame_;
  std::optional<wire::ClientChannel> channel_;
  std::optional<sealed::SealedClient> sealed_;
  std::vector<Reply> happened_;
};

}  // namespace rtpm::test
