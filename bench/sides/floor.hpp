#pragma once

#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/sealed.hpp"
#include "settings.hpp"
#include "sides/caller.hpp"

/// The raw floor: what the sockets themselves cost. A program of system calls alone that moves the
/// same bytes as RTPM's frames (its 64-byte header and the payload) with the same wait strategy,
/// scheduling and placement. It has no sessions, deadlines, retransmission or priorities beyond its
/// threads' own.
namespace rtpm::bench {

inline constexpr std::size_t kFloorFrameSize = wire::kHeaderSize + kPayloadSize;

/// The number of bytes that the floor moves for a payload of `payload_size`: RTPM's header and the
/// payload, and over UDP a header for each datagram that RTPM would send. The floor sends these one
/// after the other without any window, acknowledgement or repetition: a lost one ends the
/// measurement.
[[nodiscard]] std::size_t floor_frame_size(Carrier carrier, std::size_t payload_size) noexcept;

/// One thread of a raw server with one socket, and the way in which its callers reach it.
struct FloorLaneConfig {
  std::string name;
  Priority priority{};
  rt::WaitConfig wait{};
  int cpu = 0;
  int connection_count = 1;        ///< TCP: how many callers will connect, each once.
  std::string host = "127.0.0.1";  ///< Numeric.
  /// The payload of each frame. Over UDP, more than one datagram allows one caller only.
  std::size_t payload_size = kPayloadSize;
  /// Both sides seal each frame with the best cipher of this host, and nothing else: no window, no
  /// next key, no session.
  bool is_sealed = false;
};

/// The largest payload of a sealed floor: it fits in one datagram.
inline constexpr std::size_t kSealedPayloadMax = wire::sealed_payload_max(wire::Medium::kDatagram);

/// Starts a raw echo server in this process, one thread and one port per lane, which serves until
/// the process ends. A frame whose first eight bytes are not zero asks it to compute for that many
/// nanoseconds first.
/// @return   the lanes' ports, in order
/// @realtime set-up only
[[nodiscard]] Outcome<std::vector<std::uint16_t>> start_floor_server(
    Carrier carrier, const std::vector<FloorLaneConfig>& lanes, rt::RealtimeMode realtime);

/// Connects a raw caller to a lane's port.
/// @realtime set-up only
[[nodiscard]] Outcome<Call> connect_floor_caller(Carrier carrier, std::uint16_t port,
                                                 const FloorLaneConfig& lane);

/// Like connect_floor_caller(), over UDP: a pipeline on one socket.
[[nodiscard]] Outcome<Pipeline> connect_floor_pipeline(std::uint16_t port,
                                                       const FloorLaneConfig& lane);

// The parts that all raw floors share.

/// Starts a lane's thread, which runs until the process ends.
[[nodiscard]] Outcome<> start_floor_thread(const FloorLaneConfig& lane, rt::RealtimeMode realtime,
                                           std::function<void()> body);

using FloorFrame = std::vector<std::byte>;

/// The frame that a caller sends, with its bytes all different so that a mix-up shows.
[[nodiscard]] inline FloorFrame make_floor_frame(std::size_t size) {
  FloorFrame frame(size);
  for (std::size_t i = wire::kHeaderSize; i < size; ++i)
    frame[i] = static_cast<std::byte>(i);
  return frame;
}

inline void compute_as_asked(const FloorFrame& frame) noexcept {
  const auto work_ns = load_le<std::uint64_t>(frame.data());
  if (work_ns != 0) compute_for(Duration{static_cast<Duration::rep>(work_ns)});
}

/// The vectors' own comparison goes byte by byte, which takes as long as to move them.
[[nodiscard]] inline Outcome<> check_floor_echo(const FloorFrame& sent,
                                                const FloorFrame& received) {
  if (std::memcmp(received.data(), sent.data(), sent.size()) == 0) return {};
  return failure("the raw floor's echo differs");
}

/// A caller that sends one frame again and again. `exchange(sent, received)` is one call.
template <class Exchange>
[[nodiscard]] Call make_floor_caller(std::size_t frame_size, Exchange exchange) {
  struct State {
    Exchange exchange;
    FloorFrame sent;
    FloorFrame received;
  };
  // Shared because calls are copied.
  auto state = std::make_shared<State>(
      State{std::move(exchange), make_floor_frame(frame_size), FloorFrame(frame_size)});
  return [state](Duration work) -> Outcome<> {
    store_le(state->sent.data(), static_cast<std::uint64_t>(work.count()));
    if (auto moved = state->exchange(state->sent, state->received); !moved) return moved;
    return check_floor_echo(state->sent, state->received);
  };
}

}  // namespace rtpm::bench
