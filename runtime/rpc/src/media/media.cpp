#include "media/media.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "model/lane_setup.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::rpc {
namespace {

// A connection that has opened no session in this time may be replaced.
constexpr Duration kSessionPatience = std::chrono::seconds{2};

// One buffer more than messages may be held: the one where replies are written.
std::size_t message_memory(const ServerConfig& server) noexcept {
  return wire::large_buffer_size(server.message_size_max) * (server.large_message_count_max + 1);
}

std::size_t item_memory(const ServerConfig& server, wire::Medium medium) noexcept {
  return server.stream_count_max * wire::stream_buffer_size(medium);
}

wire::ServerSessionsConfig sessions_config(const LaneSetup& setup, wire::Medium medium,
                                           bool is_memory, MutableBytes messages,
                                           MutableBytes items) noexcept {
  const ServerConfig& server = *setup.server;
  wire::ServerSessionsConfig config;
  config.medium = medium;
  config.band = setup.band();
  config.ceiling = server.ceiling;
  config.epoch = setup.epoch;
  config.clock_domain = setup.clock_domain;
  config.key = setup.key;
  config.lane = setup.number;
  config.lane_count = static_cast<std::uint32_t>(server.lanes.size());
  config.session_count_max = server.session_count_max;
  config.message_size_max = server.message_size_max;
  config.large_memory = messages;
  config.stream_memory = items;
  // Each medium has its own secret, so that a session number of one medium is invalid in another.
  if (medium == wire::Medium::kStream) config.key.low = ~config.key.low;
  if (is_memory) {
    config.key.high = ~config.key.high;
    config.frame_payload_max = static_cast<std::uint32_t>(wire::kSharedPayloadSizeMax);
  } else if (setup.access != nullptr) {
    config.frame_payload_max = static_cast<std::uint32_t>(wire::sealed_payload_max(medium));
  }
  return config;
}

}  // namespace

Media::Medium::Medium(const LaneSetup& setup, wire::Medium medium, bool is_memory)
    : messages(message_memory(*setup.server)),
      items(item_memory(*setup.server, medium)),
      sessions(sessions_config(setup, medium, is_memory, messages.bytes(), items.bytes())),
      has_memory(messages.bytes().size() == message_memory(*setup.server) &&
                 items.bytes().size() == item_memory(*setup.server, medium)) {}

Media::Media(const LaneSetup& setup, std::vector<transport::UdpPort> ports,
             transport::WaitSet& wait_set, LaneReport& report)
    : report_(report),
      handover_(wait_set, *setup.acceptor_bell),
      datagrams_(setup, wire::Medium::kDatagram, /*is_memory=*/false),
      streams_(setup, wire::Medium::kStream, /*is_memory=*/false),
      memory_(setup, wire::Medium::kStream, /*is_memory=*/true),
      seals_(setup.access == nullptr ? nullptr
                                     : std::make_unique<Seals>(setup, datagrams_.sessions,
                                                               streams_.sessions, wait_set)),
      connections_(2 * std::size_t{setup.server->session_count_max}, wait_set) {
  sealed::SealedServer* const datagram_seals =
      seals_ != nullptr && seals_->has_memory() ? &seals_->datagrams() : nullptr;
  for (transport::UdpPort& port : ports)
    ports_.push_back(std::make_unique<DatagramPort>(std::move(port), report, datagram_seals));
}

wire::FrameCounters Media::counters() const noexcept {
  wire::FrameCounters sum = datagrams_.sessions.counters();
  sum.add(streams_.sessions.counters());
  sum.add(memory_.sessions.counters());
  if (seals_ != nullptr) sum.add(seals_->counters());
  return sum;
}

MonotonicTime Media::next_time() const noexcept {
  const MonotonicTime next =
      std::min({datagrams_.sessions.next_time(), streams_.sessions.next_time(),
                memory_.sessions.next_time()});
  return seals_ == nullptr ? next : std::min(next, seals_->next_time());
}

void Media::admit(Lead& lead, std::unique_ptr<transport::Connection> stream) noexcept {
  const MonotonicTime now = rt::now();
  if (!make_room_for(lead, *stream, now)) {
    return turn_away(lead, std::move(stream), now);
  }
  if (!connections_.add(stream, now)) return handover_.give_back(std::move(stream));
  ++report_.counters(lead).connection_count;
}

// Whether the host may open another connection. It may replace the longest-silent one; of the same
// host, once that host has its share. Half of the slots are reserved for shared memory.
bool Media::make_room_for(Lead& lead, const transport::Connection& stream,
                          MonotonicTime now) noexcept {
  const wire::PeerAddress host = stream.host();
  const auto slots = connections_.of_medium(stream.is_memory());
  const auto count_max = static_cast<std::uint32_t>(connections_.count_max() / 2);
  const std::uint32_t share = wire::share_of_one_host(count_max);
  if (slots.size() < share) return true;
  const auto is_own = [&](const Slot* slot) { return wire::is_same_host(slot->peer, host); };
  const bool has_share = std::cmp_greater_equal(std::ranges::count_if(slots, is_own), share);
  if (!has_share && slots.size() < count_max) return true;
  const wire::ServerSessions& sessions = sessions_of(stream.is_memory());
  Slot* longest = nullptr;
  for (Slot* const slot : slots) {
    if ((has_share && !is_own(slot)) || now - slot->heard < kSessionPatience) continue;
    if (longest != nullptr && slot->heard >= longest->heard) continue;
    // hp-5.5-1: a client that still uses its session sends more often.
    const bool may_go =
        now - slot->heard >= wire::kSessionIdleMin || !sessions.has_session(slot->peer);
    if (may_go) longest = slot;
  }
  if (longest != nullptr) retire(lead, *longest);
  return longest != nullptr;
}

// Over TCP the connection's first frame has arrived, so its client can get a refusal. Otherwise the
// client just sees the connection end.
void Media::turn_away(Lead& lead, std::unique_ptr<transport::Connection> stream,
                      MonotonicTime now) noexcept {
  if (const auto frame = stream->receive()) {
    const ConstBytes refusal = sessions_of(stream->is_memory()).turn_away(*frame, now);
    if (!refusal.empty()) static_cast<void>(stream->send(refusal, transport::kAlready));
  }
  handover_.give_back(std::move(stream));
  ++report_.counters(lead).connection_refused_count;
}

void Media::retire(Lead& lead, Slot& slot) noexcept {
  sessions_of(slot).end_connection(slot.peer);
  handover_.give_back(connections_.remove(slot));
  ++report_.counters(lead).connection_lost_count;
}

bool Media::send(Lead& lead, wire::ServerSessions& sessions, Slot& slot,
                 ConstBytes frame) noexcept {
  for (; !frame.empty(); frame = sessions.next_frame(rt::now())) {
    if (!send_frame(lead, slot, frame)) return false;
  }
  return true;
}

bool Media::send_frame(Lead& lead, Slot& slot, ConstBytes frame) noexcept {
  if (seals_ != nullptr && !slot.is_memory) frame = seals_->streams().seal(frame);
  return frame.empty() || send_as_is(lead, &slot, slot.peer, frame);
}

// Gives up on a peer that does not receive its replies, instead of waiting for it (hp-16.4-2).
bool Media::send_as_is(Lead& lead, Slot* slot, const wire::PeerAddress& peer,
                       ConstBytes frame) noexcept {
  if (slot == nullptr) {
    port_of(peer).send_alone(lead, peer, frame);
    return true;
  }
  if (slot->stream->send(frame, transport::kAlready)) return true;
  ++report_.counters(lead).send_failure_count;
  return false;
}

void Media::close(Lead& lead) noexcept {
  handover_.close();
  for (const auto& port : ports_)
    port->close();
  report_.counters(lead).connection_lost_count += connections_.clear();
}

}  // namespace rtpm::rpc
