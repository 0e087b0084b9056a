#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "rtpm/base/time.hpp"
#include "rtpm/device_falcon/kinematics.hpp"
#include "rtpm/device_falcon/protocol.hpp"
#include "rtpm/device_falcon/transport.hpp"
#include "rtpm/driver/geometry.hpp"

namespace rtpm::device_falcon {

inline constexpr std::size_t kButtonCount = 4;

/// The motors' commands until the next request.
/// @ownership plain value, trivially copyable
struct ForceRequest {
  std::uint64_t number = 0;  ///< Differs from the last request's; 0 before the first.
  LegCounts counts{};
  MonotonicTime deadline{};  ///< When the force must have ended.
};

/// The unit's newest state, in the mechanism's frame.
/// @ownership plain value, trivially copyable
struct FalconState {
  std::uint64_t report_count = 0;   ///< Packets that were taken.
  std::uint64_t corrupt_count = 0;  ///< Dropped packets, and runs of other bytes.
  MonotonicTime time{};             ///< When the last one came.
  bool is_homed = false;            ///< If false, position and velocity are invalid.
  driver::Vector3 position_m{};
  driver::Vector3 velocity_m_per_s{};
  std::uint8_t buttons = 0;
  std::array<std::uint16_t, kButtonCount> button_edges{};  ///< Modulo 65536.
};

/// The velocity over the last positions: the steps of the encoders are too coarse for two.
/// @realtime alloc-free
class VelocityWindow {
 public:
  [[nodiscard]] driver::Vector3 update(const driver::Vector3& position_m, MonotonicTime time);
  void reset() noexcept { size_ = 0; }

 private:
  struct Point {
    driver::Vector3 position_m{};
    MonotonicTime time{};
  };
  static constexpr std::size_t kPointCount = 8;
  std::array<Point, kPointCount> points_{};
  std::size_t newest_ = 0;
  std::size_t size_ = 0;
};

/// The conversation with a unit whose firmware runs: one packet there, one back, repeatedly. The
/// unit applies force only while it is homed, its last packet was sound, and the request is live.
/// The transport provides the time, so that a test needs no clock.
/// @ownership refers to its transport, which must outlive it
/// @threads  one at a time
/// @realtime alloc-free
class Session {
 public:
  /// Times without an answer after which the packet is repeated, the unit is late, it is gone.
  static constexpr Duration kRepeatAfter = std::chrono::milliseconds{10};
  static constexpr Duration kLateAfter = std::chrono::milliseconds{5};
  static constexpr Duration kGoneAfter = std::chrono::milliseconds{100};
  /// A request without an earlier deadline ends after this time.
  static constexpr Duration kRequestLife = std::chrono::milliseconds{100};
  /// How long stop() tries to reach the unit.
  static constexpr Duration kStopPatience = std::chrono::milliseconds{50};
  /// Faster than a hand or the motors move a leg: some 10 m/s.
  static constexpr int kCountsPerMillisecondMax = 250;
  /// Beyond the stops of the mechanism, about the middle of the workspace.
  static constexpr double kReachMetres = 0.065;
  /// Packets in a row with the homed bits before the unit counts as homed.
  static constexpr std::uint32_t kHomedPacketCount = 10;

  explicit Session(Transport& transport);

  /// Sends what is due and takes what came; waits for at most `patience`.
  /// @return false if the unit is gone
  [[nodiscard]] bool step(const ForceRequest& request, Duration patience);
  /// Sets the force to zero, if the unit still takes commands. Only once.
  void stop();

  [[nodiscard]] const FalconState& state() const noexcept { return state_; }
  /// No packet for kLateAfter.
  [[nodiscard]] bool is_late() const { return transport_.now() - answered_at_ > kLateAfter; }

 private:
  [[nodiscard]] bool send(const ForceRequest& request, MonotonicTime now);
  [[nodiscard]] bool is_live(const ForceRequest& request, MonotonicTime now);
  void take(const EncoderReport& report, MonotonicTime time);
  [[nodiscard]] bool is_leap(const LegCounts& counts, MonotonicTime time) const;
  [[nodiscard]] bool take_position(const LegCounts& counts, MonotonicTime time);
  void take_homed(bool is_homed);
  void take_buttons(std::uint8_t buttons);

  Transport& transport_;
  PacketParser parser_{};
  FalconState state_{};
  VelocityWindow velocity_{};
  std::array<std::byte, kTransferSize> transfer_{};
  bool is_awaiting_ = false;
  bool is_stopped_ = false;
  /// Whether the last packet may be used: a doubtful position gets no force.
  bool is_sound_ = false;
  MonotonicTime sent_at_{};
  MonotonicTime answered_at_;
  std::uint64_t request_number_ = 0;
  MonotonicTime requested_at_{};
  std::uint32_t homed_packet_count_ = 0;
  std::uint8_t last_buttons_ = 0;
  std::uint64_t refused_count_ = 0;
  /// The last good counts; nullopt if any counts are accepted.
  std::optional<LegCounts> counts_{};
};

}  // namespace rtpm::device_falcon
