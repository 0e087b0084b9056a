#include <array>
#include <atomic>
#include <cstring>
#include <optional>
#include <vector>

#include "rtpm/base/whole_number.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/wire/limits.hpp"
#include "sides/event_sides.hpp"
#include "sides/floor.hpp"
#include "sides/raw_socket.hpp"

// Two raw hops over UDP, from supplier to relay and from relay to each consumer, or one hop without
// a relay, with as many bytes as RTPM's frame has: its header, the event's header and the payload.
namespace rtpm::bench {
namespace {

using Frame = std::array<std::byte, wire::kHeaderSize + 64 + sizeof(EventStamp)>;
constexpr std::byte kJoin{1};
constexpr std::byte kEvent{2};

RawSocket open_socket() {
  RawSocket socket = RawSocket::open(SOCK_DGRAM);
  static_cast<void>(socket.bind("0.0.0.0"));
  // The time-out lets a reader check regularly whether it shall end.
  socket.set_patience({.tv_sec = 0, .tv_usec = 100'000});
  return socket;
}

void relay(const RawSocket& socket, const rt::WaitConfig& wait) {
  std::vector<sockaddr_in> consumers;
  Frame frame{};
  sockaddr_in from{};
  for (;;) {
    bool has_frame = false;
    if (wait.strategy != rt::WaitStrategy::kBlock) {
      const MonotonicTime spin_end = rt::now() + wait.spin;
      while (!has_frame && rt::now() < spin_end)
        has_frame = socket.receive(frame, MSG_DONTWAIT, &from) > 0;
    }
    if (!has_frame) has_frame = socket.receive(frame, 0, &from) > 0;
    if (!has_frame) continue;
    if (frame[0] == kJoin) {
      consumers.push_back(from);
      socket.send(frame, &from);
      continue;
    }
    for (const sockaddr_in& consumer : consumers)
      socket.send(frame, &consumer);
  }
}

class RelaySide final : public EventSide {
 public:
  ~RelaySide() override {
    is_stopping_ = true;
    threads_.clear();
  }
  /// `relay` is nullopt if there is none.
  [[nodiscard]] Outcome<> begin(const EventSetting& setting,
                                const std::optional<sockaddr_in>& relay, EventBoard& board) {
    if (relay) targets_.push_back(*relay);
    for (int i = 0; i < setting.consumer_count; ++i)
      sockets_.push_back(open_socket());
    for (std::size_t i = 0; i < sockets_.size(); ++i) {
      if (!relay) {
        targets_.push_back(address_of("127.0.0.1", sockets_[i].port()));
      } else if (!join(sockets_[i])) {
        return failure("the raw floor's relay does not answer");
      }
      auto thread = rt::Thread::start({.name = "floor-consumer",
                                       .priority = kHighPriority,
                                       .cpus = {setting.placement.client_cpu},
                                       .realtime = setting.realtime},
                                      [this, i, &board] { consume(sockets_[i], i, board); });
      if (!thread) return failure(thread.error());
      threads_.push_back(std::move(*thread));
    }
    return {};
  }
  Outcome<> push(const EventStamp& stamp) override {
    Frame frame{kEvent};
    std::memcpy(frame.data() + frame.size() - sizeof stamp, &stamp, sizeof stamp);
    for (const sockaddr_in& target : targets_)
      supplier_.send(frame, &target);
    return {};
  }

 private:
  [[nodiscard]] bool join(const RawSocket& consumer) const noexcept {
    Frame frame{kJoin};
    return consumer.send(frame, &targets_.front()) && consumer.receive(frame, 0) > 0;
  }
  void consume(const RawSocket& socket, std::size_t number, EventBoard& board) const {
    Frame frame{};
    while (!is_stopping_) {
      if (socket.receive(frame, 0) <= 0 || frame[0] != kEvent) continue;
      board.note(number, ConstBytes(frame).last(sizeof(EventStamp)), rt::now());
    }
  }

  std::vector<sockaddr_in> targets_{};  ///< The supplier's targets: the relay, or each consumer.
  RawSocket supplier_ = open_socket();
  std::vector<RawSocket> sockets_{};
  std::atomic<bool> is_stopping_{false};
  std::vector<rt::Thread> threads_{};
};

}  // namespace

Outcome<ServerProcess> start_event_relay(const EventSetting& setting) {
  return start_between(setting, [&setting]() -> Outcome<std::string> {
    auto socket = std::make_shared<RawSocket>(open_socket());
    const auto started = start_floor_thread(
        {.name = "floor-relay", .priority = kHighPriority, .cpu = setting.placement.server_cpu},
        setting.realtime, [socket, wait = setting.wait] { relay(*socket, wait); });
    if (!started) return failure(started.error());
    return std::to_string(socket->port());
  });
}

Outcome<std::unique_ptr<EventSide>> connect_relay(const EventSetting& setting,
                                                  const std::string& relay, EventBoard& board) {
  const std::string host(setting.network == nullptr ? "127.0.0.1" : NetworkPair::kServerAddress);
  std::optional<sockaddr_in> target;
  if (const auto port = whole_number_of<std::uint16_t>(relay)) target = address_of(host, *port);
  auto side = std::make_unique<RelaySide>();
  if (auto begun = side->begin(setting, target, board); !begun) return failure(begun.error());
  return side;
}

}  // namespace rtpm::bench
