#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "media/datagram_port.hpp"
#include "media/handover.hpp"
#include "model/connections.hpp"
#include "model/report.hpp"
#include "rtpm/rt/lazy_memory.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "security/seals.hpp"

namespace rtpm::rpc {

struct LaneSetup;

/// The peers of a lane over its three media, and their sessions: receives and sends frames, and
/// decides which peers may have a connection.
/// @threads  one at a time, with the lane's Lead
/// @realtime alloc-free except construction
class Media {
 public:
  /// @param ports  at least one; if several, each with its index
  Media(const LaneSetup& setup, std::vector<transport::UdpPort> ports, transport::WaitSet& wait_set,
        LaneReport& report);

  /// False if the system lacked memory for large messages or streams.
  [[nodiscard]] bool has_memory() const noexcept {
    return datagrams_.has_memory && streams_.has_memory && memory_.has_memory &&
           (seals_ == nullptr || seals_->has_memory());
  }

  [[nodiscard]] Handover& handover() noexcept { return handover_; }
  /// One port for each served address; a single one for "any".
  [[nodiscard]] std::span<const std::unique_ptr<DatagramPort>> ports() const noexcept {
    return ports_;
  }
  /// The port for the peer's datagrams.
  [[nodiscard]] DatagramPort& port_of(const wire::PeerAddress& peer) const noexcept {
    return *ports_[ports_.size() == 1 ? 0 : transport::UdpPort::index_of(peer)];
  }
  [[nodiscard]] bool has_leftover_datagrams() const noexcept {
    return std::ranges::any_of(ports_, [](const auto& port) { return port->has_leftovers(); });
  }
  /// Sends the waiting datagrams.
  void flush(Lead& lead) noexcept {
    for (const auto& port : ports_)
      port->flush(lead);
  }
  /// Whether frames can arrive from one UDP port only.
  [[nodiscard]] bool has_one_source() const noexcept {
    return ports_.size() == 1 && connections_.count() == 0;
  }
  [[nodiscard]] Connections& connections() noexcept { return connections_; }
  [[nodiscard]] const Connections& connections() const noexcept { return connections_; }
  [[nodiscard]] wire::ServerSessions& datagrams() noexcept { return datagrams_.sessions; }
  [[nodiscard]] wire::ServerSessions& sessions_of(const Slot& slot) noexcept {
    return sessions_of(slot.is_memory);
  }
  /// The sessions over datagrams, streams and shared memory.
  [[nodiscard]] std::array<const wire::ServerSessions*, 3> all() const noexcept {
    return {&datagrams_.sessions, &streams_.sessions, &memory_.sessions};
  }
  /// Visits the sessions of each medium.
  template <class Visitor>
  void for_each(Visitor visit) noexcept {
    for (Medium* medium : {&datagrams_, &streams_, &memory_})
      visit(medium->sessions);
  }
  /// Null if no session is sealed, as the server does not authenticate callers.
  [[nodiscard]] Seals* seals() noexcept { return seals_.get(); }
  /// Handles a received frame, which may be malformed, and may be opened in place.
  [[nodiscard]] wire::Verdict on_datagram(MutableBytes frame, const wire::PeerAddress& peer,
                                          MonotonicTime now) noexcept {
    if (seals_ == nullptr) [[likely]]
      return datagrams_.sessions.on_frame(frame, peer, now);
    return seals_->on_datagram(frame, peer, now);
  }
  [[nodiscard]] wire::Verdict on_frame(const Slot& slot, MutableBytes frame,
                                       MonotonicTime now) noexcept {
    if (seals_ == nullptr || slot.is_memory) [[likely]]
      return sessions_of(slot).on_frame(frame, slot.peer, now);
    return seals_->on_stream_frame(frame, slot.peer, now);
  }
  [[nodiscard]] wire::FrameCounters counters() const noexcept;
  /// When the first timer is due.
  [[nodiscard]] MonotonicTime next_time() const noexcept;

  /// Accepts a new connection, evicting a silent one if necessary, or refuses it.
  void admit(Lead&, std::unique_ptr<transport::Connection> stream) noexcept;
  /// Ends a connection. Take its calls' tags from its sessions at once: later, another call may use
  /// the slot of a cancelled one.
  void retire(Lead&, Slot& slot) noexcept;
  /// The connection of `peer`; null for datagrams, and once it has ended.
  [[nodiscard]] Slot* slot_of(const wire::ServerSessions& sessions,
                              const wire::PeerAddress& peer) noexcept {
    return &sessions == &datagrams_.sessions ? nullptr : connections_.of_peer(peer);
  }
  /// Sends a frame that answers the current one, and the frames of `sessions` that follow it.
  /// @return false if the peer does not receive its frames: retire it
  [[nodiscard]] bool send(Lead&, wire::ServerSessions& sessions, Slot& slot,
                          ConstBytes frame) noexcept;
  /// Sends one frame of a session to its connection, sealed if the session is.
  /// @return as send()
  [[nodiscard]] bool send_frame(Lead&, Slot& slot, ConstBytes frame) noexcept;
  /// Sends one frame as it is.
  /// @param slot  the peer's connection; null for datagrams
  /// @return as send()
  [[nodiscard]] bool send_as_is(Lead&, Slot* slot, const wire::PeerAddress& peer,
                                ConstBytes frame) noexcept;
  /// Ends all connections and closes the ports, once no thread of the lane runs.
  void close(Lead&) noexcept;

 private:
  struct Medium {
    Medium(const LaneSetup& setup, wire::Medium medium, bool is_memory);
    rt::LazyMemory messages;
    rt::LazyMemory items;
    wire::ServerSessions sessions;
    bool has_memory;
  };

  [[nodiscard]] wire::ServerSessions& sessions_of(bool is_memory) noexcept {
    return (is_memory ? memory_ : streams_).sessions;
  }
  [[nodiscard]] bool make_room_for(Lead&, const transport::Connection& stream,
                                   MonotonicTime now) noexcept;
  void turn_away(Lead&, std::unique_ptr<transport::Connection> stream, MonotonicTime now) noexcept;

  LaneReport& report_;
  Handover handover_;
  Medium datagrams_;
  Medium streams_;
  Medium memory_;
  std::unique_ptr<Seals> seals_;
  std::vector<std::unique_ptr<DatagramPort>> ports_;
  Connections connections_;
};

}  // namespace rtpm::rpc
