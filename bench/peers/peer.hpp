#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/rt/thread.hpp"
#include "runs/peer_board.hpp"
#include "sides/caller.hpp"
#include "sides/event_board.hpp"
#include "sides/event_sides.hpp"

/// What each peer's program does in its own way. peer_main.cpp does the rest: processes,
/// priorities, CPUs and measuring.
namespace rtpm::bench {

/// The payload of a call there and back: as many bytes as the paper's six doubles.
struct PeerMessage {
  std::uint64_t work_ns = 0;  ///< For how long the server shall compute first.
  std::array<double, 5> values{};
};
static_assert(sizeof(PeerMessage) == kPayloadSize);

/// What every peer's server does with a request.
inline void answer(const PeerMessage& request) noexcept {
  if (request.work_ns != 0) compute_for(Duration{static_cast<Duration::rep>(request.work_ns)});
}

/// One of a server's ends: for the measured caller, or for those of low priority.
struct PeerLane {
  std::size_t index = 0;
  std::string transport{};
  std::string folder{};      ///< Where sockets with names go.
  int connection_count = 1;  ///< How many callers will connect.
  Priority priority{};       ///< Of the thread that serves it or calls it.
  [[nodiscard]] std::string socket_path() const { return folder + "/lane" + std::to_string(index); }
};

/// A caller whose calls carry a PeerMessage.
class PeerCaller : public Caller {
 public:
  expected<void, std::string> echo() final { return call(Duration{0}); }
  expected<void, std::string> work(Duration duration) final { return call(duration); }

 protected:
  /// One call and its answer; a failure is due a second after the call at the latest.
  [[nodiscard]] virtual expected<void, std::string> exchange(const PeerMessage& request,
                                                             PeerMessage& reply) = 0;

 private:
  expected<void, std::string> call(Duration duration) {
    const PeerMessage request{static_cast<std::uint64_t>(duration.count()), {1, -2, 3, -4, 5}};
    PeerMessage reply;
    if (auto done = exchange(request, reply); !done) return done;
    if (reply.work_ns != request.work_ns || reply.values != request.values) {
      return unexpected{std::string("the echo differs")};
    }
    return {};
  }
};

/// Says where a lane is reached, from when it answers.
using Announce = std::function<void(const std::string& address)>;

/// A broker that is not part of a library. It takes the place of the peer's program.
struct BrokerProgram {
  std::vector<std::string> command;  ///< With its path first.
  std::string address;               ///< For connect_events().
  std::uint16_t port = 0;            ///< It serves once this accepts connections,
  std::string path{};                ///< or, if not empty, the socket of this name.
};

/// A peer's server and client, of calls, of events, or of both. All functions run on threads that
/// have the lane's policy, priority and CPU already; what threads the library starts there inherit
/// them. An exception of the library is caught outside and told.
class Peer {
 public:
  virtual ~Peer() = default;
  /// Serves a lane. Announces once; then either serves on this thread without end, or returns while
  /// threads of the library serve. Lanes are served at the same time, each from a thread of its
  /// own.
  [[nodiscard]] virtual expected<void, std::string> serve(const PeerLane& lane,
                                                          const Announce& publish_link_report) {
    static_cast<void>(lane);
    static_cast<void>(publish_link_report);
    return unexpected{std::string("this peer makes no calls")};
  }
  /// Connects one caller, which one thread uses: this one, or one of the same priority.
  [[nodiscard]] virtual expected<std::unique_ptr<Caller>, std::string> connect(
      const PeerLane& lane, const std::string& address) {
    static_cast<void>(lane);
    static_cast<void>(address);
    return unexpected{std::string("this peer makes no calls")};
  }
  /// Whether callers of low priority, too, are connected on a thread of high priority, because the
  /// library can't connect otherwise.
  [[nodiscard]] virtual bool connects_at_high_priority() const { return false; }

  /// The broker between supplier and consumers, if it is a program of its own; else serve_events()
  /// is it.
  [[nodiscard]] virtual std::optional<BrokerProgram> broker_program(const PeerLane& lane) {
    static_cast<void>(lane);
    return std::nullopt;
  }
  /// As serve().
  [[nodiscard]] virtual expected<void, std::string> serve_events(
      const PeerLane& lane, const Announce& publish_link_report) {
    static_cast<void>(lane);
    static_cast<void>(publish_link_report);
    return unexpected{std::string("this peer has no events")};
  }
  /// Connects a supplier and so many consumers, which note on the board what reaches them.
  /// Consumers may not have joined yet when it returns.
  [[nodiscard]] virtual expected<std::unique_ptr<EventSide>, std::string> connect_events(
      const PeerLane& lane, const std::string& address, int consumer_count, EventBoard& board) {
    static_cast<void>(lane);
    static_cast<void>(address);
    static_cast<void>(consumer_count);
    static_cast<void>(board);
    return unexpected{std::string("this peer has no events")};
  }
};

/// A peer whose supplier sends straight to the consumers: there is nothing in between to serve.
class BrokerlessPeer : public Peer {
 public:
  expected<void, std::string> serve_events(const PeerLane&,
                                           const Announce& publish_link_report) final {
    publish_link_report("none");
    return {};
  }
};

/// A side whose consumers are never slow on purpose, and are told of no losses.
class PeerEventSide : public EventSide {
 public:
  void set_slow(int) final {}
  [[nodiscard]] std::uint64_t lost_count() const final { return 0; }
};

/// A `Side` of which begin() took the arguments, or the error that it told.
template <class Side, class... Arguments>
[[nodiscard]] expected<std::unique_ptr<EventSide>, std::string> begin_side(
    Arguments&&... arguments) {
  auto side = std::make_unique<Side>();
  auto begun = side->begin(std::forward<Arguments>(arguments)...);
  if (!begun) return unexpected{begun.error()};
  return std::unique_ptr<EventSide>(std::move(side));
}

/// A caller, connected by its connect(), or the error that it told.
template <class Connecting>
[[nodiscard]] expected<std::unique_ptr<Caller>, std::string> connect_caller(
    const std::string& address) {
  auto caller = std::make_unique<Connecting>();
  if (auto connected = caller->connect(address); !connected) return unexpected{connected.error()};
  return std::unique_ptr<Caller>(std::move(caller));
}

/// A thread of a consumer, with the scheduling of the thread that starts it.
[[nodiscard]] expected<rt::Thread, std::string> start_consumer(std::function<void()> body);

/// The peer of this program: each program defines it once.
[[nodiscard]] std::unique_ptr<Peer> make_peer();

}  // namespace rtpm::bench
