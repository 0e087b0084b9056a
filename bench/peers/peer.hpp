#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "caller.hpp"
#include "peer_board.hpp"
#include "rtpm/base/expected.hpp"

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

/// A peer's server and client. All functions run on threads that have the lane's policy, priority
/// and CPU already; what threads the library starts there inherit them. An exception of the library
/// is caught outside and told.
class Peer {
 public:
  virtual ~Peer() = default;
  /// Serves a lane. Announces once; then either serves on this thread without end, or returns while
  /// threads of the library serve. Lanes are served at the same time, each from a thread of its
  /// own.
  [[nodiscard]] virtual expected<void, std::string> serve(const PeerLane& lane,
                                                          const Announce& announce) = 0;
  /// Connects one caller, which one thread uses: this one, or one of the same priority.
  [[nodiscard]] virtual expected<std::unique_ptr<Caller>, std::string> connect(
      const PeerLane& lane, const std::string& address) = 0;
  /// Whether callers of low priority, too, are connected on a thread of high priority, because the
  /// library can't connect otherwise.
  [[nodiscard]] virtual bool connects_at_high_priority() const { return false; }
};

/// The peer of this program: each program defines it once.
[[nodiscard]] std::unique_ptr<Peer> make_peer();

}  // namespace rtpm::bench
