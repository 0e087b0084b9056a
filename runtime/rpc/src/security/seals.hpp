#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "model/connections.hpp"
#include "rtpm/rt/secret_memory.hpp"
#include "rtpm/sealed/server.hpp"
#include "security/gatekeeper_link.hpp"
#include "security/lane_admission.hpp"

namespace rtpm::rpc {

struct LaneSetup;

/// A secured lane's addition to its UDP and TCP sessions: seals, handshakes and checks of the
/// grants. Shared memory is not sealed.
/// @threads  one at a time, with the lane's Lead
/// @realtime alloc-free except construction
class Seals {
 public:
  /// A frame to send, or a connection to end, without a request.
  struct Event {
    wire::PeerAddress peer{};
    ConstBytes frame{};    ///< The frame to send; empty if there is none.
    Slot* slot = nullptr;  ///< The connection; null for datagrams.
    bool ends_connection = false;
  };

  Seals(const LaneSetup& setup, wire::ServerSessions& datagrams, wire::ServerSessions& streams,
        transport::WaitSet& wait_set);

  /// False if the system lacked memory for keys.
  [[nodiscard]] bool has_memory() const noexcept { return datagrams_.server && streams_.server; }
  [[nodiscard]] GatekeeperLink& link() noexcept { return link_; }
  [[nodiscard]] sealed::SealedServer& datagrams() noexcept { return *datagrams_.server; }
  [[nodiscard]] sealed::SealedServer& streams() noexcept { return *streams_.server; }

  /// Handles a received frame, and opens it in place.
  [[nodiscard]] wire::Verdict on_datagram(MutableBytes frame, const wire::PeerAddress& peer,
                                          MonotonicTime now) noexcept {
    return on_frame(/*is_stream=*/false, frame, peer, now);
  }
  [[nodiscard]] wire::Verdict on_stream_frame(MutableBytes frame, const wire::PeerAddress& peer,
                                              MonotonicTime now) noexcept {
    return on_frame(/*is_stream=*/true, frame, peer, now);
  }

  /// Starts a turn of the lane.
  void begin_turn(MonotonicTime now) noexcept;
  /// The next handshake step done by the gatekeeper, or the next session that the grants no longer
  /// allow; a limited number per turn.
  /// @return nullopt if this turn has no more. Valid until the next call
  [[nodiscard]] std::optional<Event> next_event(Connections& connections,
                                                MonotonicTime now) noexcept;
  /// Whether a handshake advanced, or a session ended, since the last query.
  [[nodiscard]] bool take_progress() noexcept { return std::exchange(has_progress_, false); }
  /// When a turn is due without traffic.
  [[nodiscard]] MonotonicTime next_time() const noexcept;
  [[nodiscard]] wire::FrameCounters counters() const noexcept;

 private:
  struct Medium {
    rt::SecretMemory memory;
    std::optional<sealed::SealedServer> server;
  };
  enum class Review : std::uint8_t { kNone, kDatagrams, kStreams, kMemory };

  void open(Medium& medium, const LaneSetup& setup, wire::Medium kind,
            wire::ServerSessions& sessions);
  [[nodiscard]] wire::Verdict on_frame(bool is_stream, MutableBytes frame,
                                       const wire::PeerAddress& peer, MonotonicTime now) noexcept;
  [[nodiscard]] std::optional<Event> on_done(const HandshakeWork& work, Connections& connections,
                                             MonotonicTime now) noexcept;
  [[nodiscard]] std::optional<Event> review_next(Connections& connections,
                                                 MonotonicTime now) noexcept;
  [[nodiscard]] std::optional<Event> review_memory(Connections& connections) noexcept;
  void begin_part(Review part, std::size_t count) noexcept;

  const AccessControl& control_;
  LaneAdmission admission_;
  GatekeeperLink link_;
  std::uint32_t session_count_max_;
  Medium datagrams_;
  Medium streams_;
  bool has_progress_ = false;
  Review review_ = Review::kNone;
  std::size_t review_left_ = 0;  ///< How many sessions of the part are still to be judged.
  std::uint32_t turn_left_ = 0;  ///< How many of them in this turn.
  std::uint32_t reviewed_;       ///< The generation by which all were last judged.
  std::uint32_t reviewing_;      ///< The generation by which they are being judged.
};

}  // namespace rtpm::rpc
