#pragma once

#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/crypto/primitives.hpp"
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

/// One thread of a raw server with one socket.
struct FloorLaneConfig {
  std::string name;
  Priority priority{};
  rt::WaitConfig wait{};
  int cpu = 0;
  int connection_count = 1;        ///< TCP: how many callers will connect, each once.
  std::string host = "127.0.0.1";  ///< Numeric.
  /// The payload of each frame. Over UDP, more than one datagram allows one caller only.
  std::size_t payload_size = kPayloadSize;
  bool is_sealed = false;  ///< Opens each frame, and seals its answer.
};

/// The largest payload of a sealed floor: it fits in one datagram.
inline constexpr std::size_t kSealedPayloadMax = wire::sealed_payload_max(wire::Medium::kDatagram);

/// The key under which a sealed floor seals one direction, with the best cipher of this host, and
/// nothing else: no window, no next key, no session.
class FloorSeal {
 public:
  explicit FloorSeal(bool is_client) noexcept;
  /// @param sealed  wire::kSealedTrailerSize bytes larger than `frame`
  void seal(const std::vector<std::byte>& frame, std::vector<std::byte>& sealed) noexcept;
  /// @return false if the other side did not seal it
  [[nodiscard]] bool open(const std::vector<std::byte>& sealed,
                          std::vector<std::byte>& frame) const noexcept;

 private:
  crypto::AeadKey own_;
  crypto::AeadKey other_;
  std::uint64_t counter_ = 0;
};

/// Starts a raw echo server in this process, one thread and one port per lane, which serves until
/// the process ends. A frame whose first eight bytes are not zero asks it to compute for that many
/// nanoseconds first.
/// @return   the lanes' ports, in order
/// @realtime set-up only
[[nodiscard]] expected<std::vector<std::uint16_t>, std::string> start_floor_server(
    Carrier carrier, const std::vector<FloorLaneConfig>& lanes, rt::RealtimeMode realtime);

/// Connects a raw caller to a lane's port at `host`, which is numeric; its echo() sends
/// and receives `payload_size` bytes, as the lane's configuration states.
/// @realtime set-up only
[[nodiscard]] expected<std::unique_ptr<Caller>, std::string> connect_floor_caller(
    Carrier carrier, const std::string& host, std::uint16_t port, const rt::WaitConfig& wait,
    std::size_t payload_size = kPayloadSize, bool is_sealed = false);

/// Like connect_floor_caller(), over UDP: a pipeline on one socket.
[[nodiscard]] expected<std::unique_ptr<Pipeline>, std::string> connect_floor_pipeline(
    const std::string& host, std::uint16_t port);

// The parts that all raw floors share.

/// Starts a lane's thread, which runs until the process ends.
[[nodiscard]] expected<void, std::string> start_floor_thread(const FloorLaneConfig& lane,
                                                             rt::RealtimeMode realtime,
                                                             std::function<void()> body);

using FloorFrame = std::vector<std::byte>;

/// A frame as callers send it: zeros in place of RTPM's header, then bytes that differ.
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

/// A caller that sends one frame again and again. `exchange(sent, received)` is one call.
template <class Exchange>
class FloorCaller final : public Caller {
 public:
  FloorCaller(std::size_t frame_size, Exchange exchange)
      : exchange_(std::move(exchange)),
        sent_(make_floor_frame(frame_size)),
        received_(frame_size) {}
  expected<void, std::string> echo() override { return work(Duration{0}); }
  expected<void, std::string> work(Duration duration) override {
    store_le(sent_.data(), static_cast<std::uint64_t>(duration.count()));
    if (auto exchanged = exchange_(sent_, received_); !exchanged) return exchanged;
    // The vectors' own comparison goes byte by byte, which takes as long as to move them.
    if (std::memcmp(received_.data(), sent_.data(), sent_.size()) == 0) return {};
    return unexpected{std::string("the raw floor's echo differs")};
  }

 private:
  Exchange exchange_;
  FloorFrame sent_;
  FloorFrame received_;
};

template <class Exchange>
[[nodiscard]] std::unique_ptr<Caller> make_floor_caller(std::size_t frame_size, Exchange exchange) {
  return std::make_unique<FloorCaller<Exchange>>(frame_size, std::move(exchange));
}

}  // namespace rtpm::bench
