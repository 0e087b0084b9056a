#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <optional>
#include <thread>
#include <vector>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/wire/limits.hpp"
#include "sides/event_sides.hpp"

// Two raw hops over UDP, supplier to relay and relay to each consumer, or one, without a relay;
// with as many bytes as RTPM's frame has: its header, the event's header and the payload.
namespace rtpm::bench {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kFrameSize = wire::kHeaderSize + 64 + sizeof(EventStamp);
using Frame = std::array<std::byte, kFrameSize>;
constexpr std::byte kJoin{1};
constexpr std::byte kEvent{2};

/// A UDP socket of this host.
class Socket {
 public:
  Socket() : handle_(socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in address = address_of("0.0.0.0", 0);
    static_cast<void>(bind(handle_, reinterpret_cast<const sockaddr*>(&address), sizeof address));
    // So that a reader sees now and then whether it shall end.
    const timeval patience{.tv_sec = 0, .tv_usec = 100'000};
    setsockopt(handle_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  }
  Socket(Socket&& other) noexcept : handle_(std::exchange(other.handle_, -1)) {}
  Socket& operator=(Socket&&) = delete;
  ~Socket() {
    if (handle_ >= 0) close(handle_);
  }
  [[nodiscard]] static sockaddr_in address_of(const std::string& host, std::uint16_t port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = inet_addr(host.c_str());
    return address;
  }
  [[nodiscard]] std::uint16_t port() const {
    sockaddr_in address{};
    socklen_t size = sizeof address;
    getsockname(handle_, reinterpret_cast<sockaddr*>(&address), &size);
    return ntohs(address.sin_port);
  }
  void send(const Frame& frame, const sockaddr_in& to) const noexcept {
    sendto(handle_, frame.data(), frame.size(), 0, reinterpret_cast<const sockaddr*>(&to),
           sizeof to);
  }
  [[nodiscard]] bool receive(Frame& frame, sockaddr_in& from, int flags) const noexcept {
    socklen_t size = sizeof from;
    return recvfrom(handle_, frame.data(), frame.size(), flags, reinterpret_cast<sockaddr*>(&from),
                    &size) > 0;
  }

 private:
  int handle_;
};

void relay(const Socket& socket, const rt::WaitConfig& wait) {
  std::vector<sockaddr_in> consumers;
  Frame frame{};
  sockaddr_in from{};
  for (;;) {
    bool has_frame = false;
    if (wait.strategy != rt::WaitStrategy::kBlock) {
      const MonotonicTime spin_end = rt::now() + wait.spin;
      while (!has_frame && rt::now() < spin_end)
        has_frame = socket.receive(frame, from, MSG_DONTWAIT);
    }
    if (!has_frame) has_frame = socket.receive(frame, from, 0);
    if (!has_frame) continue;
    if (frame[0] == kJoin) {
      consumers.push_back(from);
      socket.send(frame, from);
      continue;
    }
    for (const sockaddr_in& consumer : consumers)
      socket.send(frame, consumer);
  }
}

class RelaySide final : public EventSide {
 public:
  /// `relay` empty: there is none.
  RelaySide(const std::string& host, const std::string& relay) {
    if (!relay.empty()) {
      relay_ = Socket::address_of(host, static_cast<std::uint16_t>(std::stoi(relay)));
    }
  }
  ~RelaySide() override {
    is_stopping_ = true;
    threads_.clear();
  }
  [[nodiscard]] expected<void, std::string> begin(const EventSetting& setting, EventBoard& board) {
    if (relay_) targets_.push_back(*relay_);
    for (int i = 0; i < setting.consumer_count; ++i)
      sockets_.emplace_back();
    for (std::size_t i = 0; i < sockets_.size(); ++i) {
      if (!relay_) {
        targets_.push_back(Socket::address_of("127.0.0.1", sockets_[i].port()));
      } else if (!join(sockets_[i])) {
        return unexpected{std::string("the raw floor's relay does not answer")};
      }
      auto thread = rt::Thread::start({.name = "floor-consumer",
                                       .priority = kHighPriority,
                                       .cpus = {setting.placement.client_cpu},
                                       .realtime = setting.realtime},
                                      [this, i, &board] { consume(sockets_[i], i, board); });
      if (!thread) return unexpected{thread.error().text()};
      threads_.push_back(std::move(*thread));
    }
    return {};
  }
  expected<void, std::string> push(const EventStamp& stamp) override {
    Frame frame{kEvent};
    std::memcpy(frame.data() + kFrameSize - sizeof stamp, &stamp, sizeof stamp);
    for (const sockaddr_in& target : targets_)
      supplier_.send(frame, target);
    return {};
  }
  void set_slow(int) override {}
  std::uint64_t lost_count() const override { return 0; }

 private:
  [[nodiscard]] bool join(const Socket& consumer) const noexcept {
    Frame frame{kJoin};
    sockaddr_in from{};
    consumer.send(frame, *relay_);
    return consumer.receive(frame, from, 0);
  }
  void consume(const Socket& socket, std::size_t number, EventBoard& board) const {
    Frame frame{};
    sockaddr_in from{};
    while (!is_stopping_) {
      if (!socket.receive(frame, from, 0) || frame[0] != kEvent) continue;
      board.note(number, ConstBytes(frame).last(sizeof(EventStamp)), rt::now());
    }
  }

  std::optional<sockaddr_in> relay_{};
  std::vector<sockaddr_in> targets_{};  ///< Of the supplier: the relay, or each consumer.
  Socket supplier_{};
  std::vector<Socket> sockets_{};
  std::atomic<bool> is_stopping_{false};
  std::vector<rt::Thread> threads_{};
};

}  // namespace

expected<ServerProcess, std::string> start_event_relay(const EventSetting& setting) {
  return ServerProcess::start([setting]() -> expected<std::string, std::string> {
    if (setting.network != nullptr) {
      auto entered = setting.network->enter(NetworkPair::Host::kServer);
      if (!entered) return unexpected{entered.error()};
    }
    auto socket = std::make_unique<Socket>();
    const std::string port = std::to_string(socket->port());
    auto thread = rt::Thread::start({.name = "floor-relay",
                                     .priority = kHighPriority,
                                     .cpus = {setting.placement.server_cpu},
                                     .realtime = setting.realtime},
                                    [its = std::shared_ptr<Socket>(std::move(socket)),
                                     wait = setting.wait] { relay(*its, wait); });
    if (!thread) return unexpected{thread.error().text()};
    // It relays until the process ends.
    static_cast<void>(new rt::Thread(std::move(*thread)));
    return port;
  });
}

expected<std::unique_ptr<EventSide>, std::string> connect_relay(const EventSetting& setting,
                                                                const std::string& relay,
                                                                EventBoard& board) {
  const std::string host(setting.network == nullptr ? "127.0.0.1" : NetworkPair::kServerAddress);
  auto side = std::make_unique<RelaySide>(host, relay);
  if (auto begun = side->begin(setting, board); !begun) return unexpected{begun.error()};
  return std::unique_ptr<EventSide>(std::move(side));
}

}  // namespace rtpm::bench
