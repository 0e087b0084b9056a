#pragma once

#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/wire/limits.hpp"
#include "settings.hpp"
#include "sides/caller.hpp"

/// The raw floor: what the sockets themselves cost. A program of system calls alone that moves the
/// same bytes as RTPM's frames (its 64-byte header and the payload) with the same wait strategy,
/// scheduling and placement. It has no sessions, deadlines, retransmission or priorities beyond its
/// threads' own.
namespace rtpm::bench {

inline constexpr std::size_t kFloorFrameSize = wire::kHeaderSize + kPayloadSize;

/// How many bytes the floor moves for `payload_size` of them: RTPM's header and the payload, and
/// over UDP a header for each datagram that RTPM would send. The floor sends these one after the
/// other without any window, acknowledgement or repetition: a lost one ends the measurement.
[[nodiscard]] std::size_t floor_frame_size(Carrier carrier, std::size_t payload_size) noexcept;

/// Whether two buffers of one size hold the same. The operators compare std::byte one by one, which
/// takes as long as to move them.
[[nodiscard]] inline bool are_same(ConstBytes one, ConstBytes other) noexcept {
  return std::memcmp(one.data(), other.data(), one.size()) == 0;
}

/// One thread of a raw server with one socket.
struct FloorLaneConfig {
  std::string name;
  Priority priority{};
  rt::WaitConfig wait{};
  int cpu = 0;
  int connection_count = 1;        ///< TCP: how many callers will connect, each once.
  std::string host = "127.0.0.1";  ///< Numeric.
  /// Of each frame. More than a datagram over UDP: of one caller only.
  std::size_t payload_size = kPayloadSize;
};

/// Starts a raw echo server in this process, one thread and one port per lane, which serves until
/// the process ends. A frame whose first eight bytes are not zero asks it to compute for that many
/// nanoseconds first. Gives back the lanes' ports, in order.   Set-up only.
[[nodiscard]] expected<std::vector<std::uint16_t>, std::string> start_floor_server(
    Carrier carrier, const std::vector<FloorLaneConfig>& lanes, rt::RealtimeMode realtime);

/// Connects a raw caller to a lane's port at `host`, which is numeric; its echo() has
/// `payload_size` bytes brought back, as many as the lane was told.   Set-up only.
[[nodiscard]] expected<std::unique_ptr<Caller>, std::string> connect_floor_caller(
    Carrier carrier, const std::string& host, std::uint16_t port, const rt::WaitConfig& wait,
    std::size_t payload_size = kPayloadSize);

/// As connect_floor_caller(), over UDP: a pipeline on one socket.   Set-up only.
[[nodiscard]] expected<std::unique_ptr<Pipeline>, std::string> connect_floor_pipeline(
    const std::string& host, std::uint16_t port, std::size_t in_flight);

}  // namespace rtpm::bench
