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

/// The motor commands until the next request.
/// @ownership plain value, trivially copyable
struct ForceRequest {
  /// Differs from the number of the previous request; 0 before the first.
  std::uint64_t number = 0;
  LegCounts counts{};
  MonotonicTime deadline{};  ///< The time at which the force must have ended.
};

/// The unit's newest state, in the mechanism's frame.
/// @ownership plain value, trivially copyable
struct FalconState {
  std::uint64_t report_count = 0;   ///< Number of accepted packets.
  std::uint64_t corrupt_count = 0;  ///< Number of dropped packets and of other byte runs.
  MonotonicTime time{};             ///< When the last packet arrived.
  bool is_homed = false;            ///< If false, the position and velocity are invalid.
  driver::Vector3 position_m{};
  driver::Vector3 velocity_m_per_s{};
  std::uint8_t buttons = 0;
  std::array<std::uint16_t, kButtonCount> button_edges{};  ///< Counted modulo 65536.
};

/// Computes the velocity from several positions: the encoder steps are too coarse for only two.
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

/// The conversation with a unit whose firmware is running: one packet to the unit, one packet back,
/// repeatedly. The unit applies force only while it is homed, its last packet was sound, and the
/// request has not expired. The transport provides the time, so that tests need no clock.
/// @ownership refers to its transport, which must outlive it
/// @threads  one at a time
/// @realtime alloc-free
class Session {
 public:
  /// Times without an answer after which the packet is repeated, the unit is late, and the unit is
  /// gone.
  static constexpr Duration kRepeatAfter = std::chrono::milliseconds{10};
  static constexpr Duration kLateAfter = std::chrono::milliseconds{5};
  static constexpr Duration kGoneAfter = std::chrono::milliseconds{100};
  /// A request ends after this time, unless its deadline is earlier.
  static constexpr Duration kRequestLife = std::chrono::milliseconds{100};
  /// How long stop() tries to reach the unit.
  static constexpr Duration kStopPatience = std::chrono::milliseconds{50};
  /// A greater speed than a hand or the motors can reach: about 10 m/s.
  static constexpr int kCountsPerMillisecondMax = 250;
  /// A distance from the centre of the workspace that is beyond the mechanical stops.
  static constexpr double kReachMetres = 0.065;
  /// Number of consecutive packets with the homed bits before the unit counts as homed.
  static constexpr std::uint32_t kHomedPacketCount = 10;

  explicit Session(Transport& transport);

  /// Sends pending packets and reads those that arrived; waits for at most `patience`.
  /// @return false if the unit is gone
  [[nodiscard]] bool step(const ForceRequest& request, Duration patience);
  /// Sets the force to zero if the unit still accepts commands. Call it only once.
  void stop();

  [[nodiscard]] const FalconState& state() const noexcept { return state_; }
  /// Whether no packet arrived for kLateAfter.
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
  /// Whether the last packet is trustworthy: a doubtful position gets no force.
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
