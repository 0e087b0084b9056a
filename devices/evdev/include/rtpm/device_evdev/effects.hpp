#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::device_evdev {

class Transport;

/// A kind of force feedback that this driver supports.
enum class EffectKind : std::uint8_t {
  kConstant,  ///< A constant torque.
  kRumble,    ///< Vibration by a strong and a weak motor.
  kSpring,    ///< A force towards the centre.
  kDamper,    ///< A force against the motion.
};

/// An effect in the form in which it is uploaded.
/// @ownership plain value
struct Effect {
  EffectKind kind = EffectKind::kConstant;
  int id = -1;  ///< −1 until the kernel assigns an id at the upload.
  /// For kConstant: a positive level pushes towards larger values of the axis.
  std::int16_t level = 0;
  std::uint16_t strong = 0;
  std::uint16_t weak = 0;
  std::int16_t coefficient = 0;  ///< For kSpring and kDamper: at least 0.
  Duration length{0};            ///< The effect ends by itself after this time.
};

/// The levels of the actuators, in the kernel's units.
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
  kRefused,  ///< The kernel refused a level, so the effect was stopped.
  kGone,     ///< The device is gone, or has refused kRefusalMax times in a row.
};

/// The effects of one device: they are uploaded once, and then only their levels change. An effect
/// ends by itself after kLength unless update() is called again, so a hanging driver leaves no
/// force. The kernel erases the effects of a program that exits.
/// @ownership refers to its transport, which must outlive it
/// @threads  one at a time
/// @realtime makes system calls that may take several milliseconds
class EffectBank {
 public:
  static constexpr Duration kLength = std::chrono::milliseconds{500};
  /// Interval at which a playing effect is restarted; much shorter than kLength.
  static constexpr Duration kRefresh = std::chrono::milliseconds{100};
  static constexpr int kRefusalMax = 20;

  EffectBank(Transport& transport, std::span<const EffectKind> kinds);

  /// Uploads all effects without playing them.
  /// @param gain  the device's gain, 0 to 1; negative if it has none
  /// @errors   described in words; no effect stays uploaded
  [[nodiscard]] expected<void, SetupError> start(double gain, bool has_autocenter);
  /// Sets the effects to `levels`.
  [[nodiscard]] EffectStatus update(const Levels& levels, MonotonicTime now) noexcept;
  /// Stops and erases all effects, even if some of the calls fail.
  void stop() noexcept;
  /// The levels that are playing.
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
