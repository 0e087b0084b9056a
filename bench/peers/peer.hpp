#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/thread.hpp"
#include "sides/caller.hpp"
#include "sides/event_board.hpp"

/// The interface that each peer's program implements in its own way. peer_main.cpp does the rest:
/// processes, threads, priorities, CPUs and measuring. The objects that a peer makes live until its
/// process ends.
namespace rtpm::bench {

/// "LIBRARY's WHAT failed: REASON".
[[nodiscard]] inline auto failure_of(const char* library, const char* what,
                                     const char* reason = "the library gives no reason") {
  return failure(std::string(library) + ": " + what + " failed: " + reason);
}

/// The lane of the measured caller, and the one of the callers of low priority.
inline constexpr std::size_t kPeerLaneCount = 2;

/// The payload of a call there and back: as many bytes as the paper's six doubles.
struct PeerMessage {
  std::uint64_t work_ns = 0;  ///< How long the server computes first.
  std::array<double, 5> values{};
};
static_assert(sizeof(PeerMessage) == kPayloadSize);

/// Does the work that a request asks every peer's server for.
inline void answer(std::uint64_t work_ns) noexcept {
  if (work_ns != 0) compute_for(Duration{static_cast<Duration::rep>(work_ns)});
}

/// One of a server's ends: for the measured caller, or for the callers of low priority.
struct PeerLane {
  std::size_t index = 0;
  std::string transport{};
  std::string folder{};      ///< Holds the sockets with names.
  int connection_count = 1;  ///< How many callers will connect.
  int caller = 0;            ///< The index of the one that connects.
  Priority priority{};       ///< The priority of the thread that serves or calls it.
  [[nodiscard]] std::string socket_path() const { return folder + "/lane" + std::to_string(index); }
};

/// Says where a lane is reached, from when it answers.
using Announce = std::function<void(const std::string& address)>;
/// One call and its reply. Fails a second after the call at the latest.
using Exchange = std::function<Outcome<>(const PeerMessage& request, PeerMessage& reply)>;
/// Sends an event.
using Push = std::function<Outcome<>(const EventStamp& stamp)>;
/// The body of a consumer's thread; empty if the library's own threads deliver.
using Consume = std::function<void()>;

/// The record where one consumer notes its events.
struct Note {
  void operator()(const void* bytes, std::size_t size) const noexcept {
    board->note(number, {static_cast<const std::byte*>(bytes), size}, rt::now());
  }
  EventBoard* board;
  std::size_t number;
};

/// A peer: calls, and perhaps events; a null function is one that it lacks. All run on threads that
/// already have the lane's policy, priority and CPU; threads that the library starts there inherit
/// them. Exceptions of the library are caught outside.
struct Peer {
  /// Serves a lane. Announces once; then either serves on this thread without end, or returns while
  /// threads of the library serve. Lanes are served at the same time, each from its own thread.
  Outcome<> (*serve)(const PeerLane& lane, const Announce& announce) = nullptr;
  /// Connects one caller, which one thread uses: this one, or one of the same priority.
  Outcome<Exchange> (*connect)(const PeerLane& lane, const std::string& address) = nullptr;
  /// Whether callers of low priority, too, connect on a thread of high priority, because the
  /// library can't connect otherwise.
  bool connects_at_high_priority = false;

  /// The broker between supplier and consumers, like serve(); null if unused.
  Outcome<> (*serve_events)(const PeerLane& lane, const Announce& announce) = nullptr;
  /// `address`: the broker's. It may have two words: the supplier's address and the consumers'.
  Outcome<Push> (*connect_supplier)(const PeerLane& lane, const std::string& address) = nullptr;
  /// The consumer may join later. `note` outlives it.
  Outcome<Consume> (*connect_consumer)(const PeerLane& lane, const std::string& address,
                                       Note& note) = nullptr;

  /// Runs `body` and turns the library's exceptions that are not std::exception into errors.
  Outcome<> (*guard)(const std::function<Outcome<>()>& body) = nullptr;
};

/// The peer of this program: each program defines it once.
extern const Peer kPeer;

/// The number of events that a queue holds before it loses some, where a peer lets us choose.
inline constexpr int kEventQueueMax = 1024;

}  // namespace rtpm::bench
