#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::device_evdev {

class Transport;

/// A kind of force feedback that this driver uses.
enum class EffectKind : std::uint8_t {
  kConstant,  ///< A torque.
  kRumble,    ///< A strong and a weak motor.
  kSpring,    ///< Towards the centre.
  kDamper,    ///< Against motion.
};

/// An effect as it is uploaded.
/// @ownership plain value
struct Effect {
  EffectKind kind = EffectKind::kConstant;
  int id = -1;             ///< −1: not yet uploaded, and the kernel assigns one.
  std::int16_t level = 0;  ///< kConstant: above 0 towards larger values of the axis.
  std::uint16_t strong = 0;
  std::uint16_t weak = 0;
  std::int16_t coefficient = 0;  ///< kSpring and kDamper: from 0.
  Duration length{0};            ///< It ends by itself after this time.
};

/// The actuators' levels, in the kernel's steps.
/// @ownership plain value, trivially copyable
struct Levels {
  std::int16_t effort = 0;
  std::uint16_t strong = 0;
  std::uint16_t weak = 0;
  std::int16_t spring = 0;
  std::int16_t damper = 0;

  friend bool operator==(const Levels&, const Levels&) = default;
};

/// Result of EffectBank::update().
enum class EffectStatus : std::uint8_t {
  kOk,
  kRefused,  ///< The kernel refused a level; that effect was stopped instead.
  kGone,     ///< The device is gone, or refused kRefusalMax times in a row.
};

/// The effects of one device: uploaded once, then only their levels change. An effect ends by
/// itself after kLength unless update() is called again, so that a driver that hangs leaves no
/// force. The kernel erases the effects of a program that ends.
/// @ownership refers to its transport, which must outlive it
/// @threads  one at a time
/// @realtime system calls that may take some milliseconds
class EffectBank {
 public:
  static constexpr Duration kLength = std::chrono::milliseconds{500};
  /// Interval at which a playing effect is restarted, far less than kLength.
  static constexpr Duration kRefresh = std::chrono::milliseconds{100};
  static constexpr int kRefusalMax = 20;

  EffectBank(Transport& transport, std::span<const EffectKind> kinds);

  /// Uploads all effects, none of them playing.
  /// @param gain  the device's gain, 0 to 1; below 0 if it has none
  /// @errors   in words; nothing stays uploaded
  [[nodiscard]] expected<void, SetupError> start(double gain, bool has_autocenter);
  /// Brings the effects to `levels`.
  [[nodiscard]] EffectStatus update(const Levels& levels, MonotonicTime now) noexcept;
  /// Stops and erases all effects, whatever fails.
  void stop() noexcept;
  /// The levels that play.
  [[nodiscard]] const Levels& applied() const noexcept { return applied_; }

 private:
  struct Slot {
    Effect effect{};
    bool is_playing = false;
    MonotonicTime started_at{};
  };
  [[nodiscard]] int update(Slot& slot, const Levels& levels, MonotonicTime now) noexcept;
  void note_applied(const Slot& slot) noexcept;

  Transport& transport_;
  std::vector<Slot> slots_{};
  Levels applied_{};
  int refusal_count_ = 0;
};

}  // namespace rtpm::device_evdev
